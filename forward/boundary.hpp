#pragma once

#include "forward/cracks.hpp"
#include "forward/loading.hpp"

#include <functional>
#include <vector>

namespace crampfit {

/// What edges and bodies prescribe on the grid's fields. A driver is an edge or a body: the edges first, then the bodies.
class Boundary {
  public:
    struct Held {  // a displacement component of a field that an edge or a bonded body prescribes
        int field;
        int axis;
        int driver;
    };
    struct Tied {  // a component that a stretch of an edge which ends there holds by a spring
        int field;
        int axis;
        int driver;
        double stiffness;      // [N/m]
        double plane_modulus;  // E' of the wood that it goes with [Pa]
        Vec2 place;            // of that wood
        Vec2 along;            // unit, the side
    };
    struct Traction {  // a force on a piece of the outline
        Facet facet;
        Vec2 force;  // [N]
        int driver;
        std::array<int, most_nodes> field;  // at the nodes that the facet's point sees, of its own side of each crack
    };

    /// Throws InputError where an edge or a bonded body meets nothing. A stretch of a side is held at its nodes, those at its
    /// ends included; with `materials` where it ends, wherever that lies in a cell. What is free beyond the end of a side that is
    /// held across is half a crack, and its displacements are as singular: the end is seen as a tip is, by a tie to the edge.
    Boundary(const Scene& scene, const Discretisation& body, const CrackFields& cracks, const MaterialMap* materials = nullptr);

    struct Holds {  // all that hangs on where the cracks lie
        std::vector<Held> held, others;
        std::vector<Tied> tied;
    };

    std::vector<Held> held;
    std::vector<Tied> tied;
    std::vector<Traction> tractions;

    int drivers() const { return edges_ + static_cast<int>(scene_.bodies.size()); }
    int first_body() const { return edges_; }

    /// Holds and loads the fields of nodes as the cracks have come to lie. Where a node has several, each is held by the first
    /// whose stretch its wood lies on, and tractions pull on that of their own side. So arms on either side of a crack's mouth
    /// are held each on its own, and wood beyond a crack that runs alongside the edge moves freely.
    void follow(const CrackFields& cracks);

    Holds holds() const { return {held, others_, tied}; }
    void go_back(const Holds& holds, const CrackFields& cracks);  // to where the cracks lay then

    Vec2 velocity_of(int driver) const;          // while it moves [m/s]
    double travel_time(int driver) const;        // it stops then [s]; infinite: never
    Vec2 travel(int driver, double time) const;  // how far it has gone, where it is prescribed [m]
    bool has_dead_load() const { return crampfit::has_dead_load(scene_); }

    /// How far a driver has gone, prescribed or, under traction, on average over its facets [m].
    Vec2 moved(int driver, double time, const std::vector<Vec2>& displacement) const;

    /// The forces on fields whose work is how far a driver under traction moves along a direction; empty where its motion is
    /// prescribed.
    std::vector<Vec2> load_to_move(int driver, const Vec2& direction, std::size_t fields) const;

  private:
    void hold_nodes(const CrackFields& cracks, const MaterialMap* materials);
    std::vector<CrackTip> ends_within(const Edge& edge, int axis, const CrackFields& cracks,
                                      const std::vector<double>& mass) const;
    void hold_further_fields(const CrackFields& cracks);
    void place_tractions(const CrackFields& cracks);
    void place_traction(const Facet& facet, int driver);
    Facet piece_of(Facet facet, int axis, double low, double high) const;
    void load_own_sides(const CrackFields& cracks);
    using Reach = std::function<bool(const Vec2& middle, const Box& wood)>;  // of a piece of wood: whether a driver is there
    Reach reach_of(const Edge& edge) const;
    Reach reach_of(const Body& grip, const CrackFields& cracks) const;
    bool reaches(const Reach& is_reached, int field, int node) const;

    const Scene& scene_;
    const Discretisation& body_;
    int edges_;
    std::vector<Held> others_;  // of nodes: what else would hold them
};

/// Whether each bonded body has a node of such a grid to hold, and each stretch of a side that moves or stands two: with one its
/// force hangs on where in a cell it ends.
bool meets_nodes(const Scene& scene, const Layout& layout);

/// What is measured: which drivers, and along which directions.
struct Gauges {
    explicit Gauges(const Scene& scene);

    int force = 0;                // driver
    int displacement = 0;         // driver
    Vec2 force_direction;         // unit; of a fixed edge that holds nothing along the load: outward; zero: nothing is driven
    Vec2 displacement_direction;  // unit; zero: nothing is driven
};

/// Mass of each field [kg]; 0 for fields that no point belongs to.
std::vector<double> field_masses(const Discretisation& body, int fields);

/// How stiff the tie of a pair is [N/m].
inline double shared_tie(const FieldPair& pair, const std::vector<double>& mass) {
    const double left = mass[pair.left];
    const double right = mass[pair.right];
    return left > 0.0 && right > 0.0 ? tie_share(left, right) * pair.tie : 0.0;
}

}  // namespace crampfit
