#pragma once

#include "forward/face_facets.hpp"
#include "forward/friction.hpp"
#include "forward/search_interval.hpp"

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <vector>

namespace crampfit {

class LocalYield;

/// Whether a body is a circle that no more than some cells go round, which feels each of the grid's bends.
bool is_small_circle(const Shape& shape, const Layout& layout);

/// A rigid body that pushes on the specimen's outline and on faces of cracks. Each facet inside it is pushed out along the body's
/// normal by a force that grows with the depth, with up to ten times the stiffness of a cell of the wood. It never pulls. Where
/// it has friction, each facet that touches is held by a spring along the surface too, as stiff, which slips by Coulomb's law.
///
/// Under a round body a facet of a smooth outline goes with the mean of the surface about it, a cell wide and up to the mouth of
/// a crack: displacements are linear from node to node, and a wheel that fits itself into each bend at a node is tilted to and
/// fro as it rolls, by 2 degrees with ten cells across. Facets of a picture's voids go alone, and those under bodies many cells
/// across. What a facet overlaps the body by at the start, in a picture's steps or by rounding, is taken for cut off.
///
/// A convex corner of a polygon pushes against the wood's own normal, on the surface within a cell of it, where that lies well
/// between the normals of the corner's sides and the surface goes on beyond it: else wood that gives way on either side of a
/// sharp edge would be pinched by them.
///
/// A crack that is closed ends at a body that presses on its mouth: faces feel only what comes from within the crack, the sides
/// of a body whose normals lie within 60 degrees of the wood's own, and as deep as it is where they are the same.
class SlidingBody {
  public:
    /// `faces` must outlive this; null: none.
    SlidingBody(const Shape& shape, const Discretisation& body, double friction = 0.0, const FaceFacets* faces = nullptr);

    /// Softens the springs so that they add at most `most_frequency_squared` to the highest squared frequency [1/s^2], for fields
    /// of these masses [kg]. From then on the facets that the body may touch are searched for now and then only.
    void limit_frequency(const std::vector<double>& mass, double most_frequency_squared);

    /// After the faces have changed in a box; `mass` of the fields, for those whose frequency is limited [kg].
    void take_in_faces(const Box& changed, const std::vector<double>& mass);

    /// From now on the wood yields by so much more than the grid, with springs as stiff for the finer cells that say so. Of
    /// circles alone.
    void let_yield(std::shared_ptr<LocalYield> yield);
    const std::shared_ptr<LocalYield>& yield() const { return yield_; }  // null: it does not
    const Shape& shape() const { return shape_; }

    /// Of the outline, what lies nearest to it at the start, and behind that what lies no more than `beyond` farther [m].
    std::vector<const Facet*> nearest_facets(double beyond) const;

    /// Finds where it pushes on the specimen, `moved` so far [m].
    void meet(const Vec2& moved, const std::vector<Vec2>& displacement);

    /// Adds the contact forces of there to the nodes. Returns the force on the specimen [N].
    Vec2 push(std::vector<Vec2>& force) const;

    /// A facet that the body pushes on.
    struct Touch {
        int facet;
        Vec2 normal;       // unit, out of the body
        double curvature;  // of the surfaces of equal depth there, 1 / radius [1/m]
        double force;      // along the normal [N]
        double stiffness;  // force per depth [N/m]
        double energy;     // [J]
        Drag drag;         // of friction
    };

    /// All facets that the body, gone so far, pushes on.
    std::vector<Touch> touches(const Vec2& moved, const std::vector<Vec2>& displacement);

    /// How a facet goes with the nodes that a point sees, one of several maybe.
    struct Hold {
        int point;
        std::array<double, most_nodes> weight;
    };
    /// The outline's first, then those of faces.
    const Facet& facet(int i) const { return i < outline() ? body_.facets[i] : faces_->all()[i - outline()]; }
    std::span<const Hold> holds(int facet) const { return holds_[facet]; }

    double stored_energy() const { return stored_energy_; }           // in the contact's springs at the last push [J]
    double dissipated() const { return dissipated_ + sliding_now_; }  // by friction so far, the last push included [J]

    /// Keeps the last push as what friction counts from.
    void settle(const Vec2& moved, const std::vector<Vec2>& displacement);

    /// What it has kept, and coming back to that: where the body and the wood were then, and what had been dissipated.
    const std::vector<Grip>& grips() const { return grips_; }
    void restore(const std::vector<Grip>& grips, double dissipated, const Vec2& moved, const std::vector<Vec2>& displacement);

  private:
    int outline() const { return static_cast<int>(body_.facets.size()); }
    int facets() const { return outline() + (faces_ ? static_cast<int>(faces_->all().size()) : 0); }
    void add_facets();
    double full_stiffness(int i) const;
    void soften(const std::vector<int>& facets, const std::vector<double>& mass);
    struct Meeting {
        double depth;               // of a place in the body, before anything is cut off [m]
        Vec2 out;                   // how fast it falls, and which way: unit but for faces of cracks
        double curvature = 0.0;     // of the surfaces of equal depth there, 1 / radius [1/m]
        double share = 1.0;         // of the facet's stiffness
        Vec2 aside = Vec2::Zero();  // how fast the logarithm of the share falls [1/m]
    };
    struct Corner {
        Vec2 at;             // [m]
        Vec2 first, second;  // out of its sides, the first a turn counter-clockwise of less than half from the second
    };
    static std::optional<Meeting> depth_in(const Shape& shape, const Vec2& x);
    static std::optional<Meeting> depth_in_crack(const Shape& shape, const Vec2& x, const Vec2& toward);
    static std::vector<Corner> corners_of(const Shape& shape);
    double corner_width() const;
    bool surface_reaches(int facet, double along) const;
    const Corner* corner_on(const Vec2& place, const Vec2& toward) const;
    std::optional<Meeting> meeting_at(int facet, const Vec2& place, const std::vector<Vec2>& displacement) const;
    double may_go() const;
    void find_near(const Vec2& moved, const std::vector<Vec2>& displacement);
    double taken_off(const Vec2& moved, const std::vector<Vec2>& displacement) const;
    Drag drag_on(const Touch& touch, const Vec2& place, double depth) const;
    int next(int facet, bool forth) const;
    bool find_joint(int facet);
    void find_holds(int facet);
    void sink(const Vec2& moved, const std::vector<Vec2>& displacement);
    double sunk_at(int facet) const;
    double depth_of(int facet, const Vec2& place) const;
    Vec2 current(int facet, const std::vector<Vec2>& displacement) const;

    Shape shape_;
    const Discretisation& body_;
    const FaceFacets* faces_;
    std::vector<Corner> corners_;
    double most_frequency_squared_ = 0.0;  // 0: not limited [1/s^2]
    double width_ = 0.0;                   // with whose mean a facet goes; 0: alone [m]
    std::vector<char> goes_on_;  // [facets] whether the next one goes on smoothly where this one ends, no crack between them
    std::vector<std::vector<Hold>> holds_;  // [facets]
    std::vector<char> is_stale_;            // [facets] of faces: what holds it must be found anew before the body comes near
    std::vector<double> stiffness_;         // [facets] [N/m]
    std::vector<double> cut_off_;           // [facets] [m]
    std::vector<int> near_;                 // facets that the body may touch before the list is made anew
    SearchInterval search_{1};
    Vec2 searched_at_ = Vec2::Zero();  // where the body had moved to at the last search [m]
    double farthest_at_search_ = 0.0;  // that anything of the specimen had gone then [m]
    double stored_energy_ = 0.0;

    // Of wood that yields by more than the grid:
    std::shared_ptr<LocalYield> yield_;
    Eigen::VectorXd sunk_;       // [stations] by how much more, at the last touches [m]
    double yield_energy_ = 0.0;  // that this took [J]

    // Friction:
    double friction_;            // coefficient; 0: none, and nothing below is there
    std::vector<Vec2> place_;    // [facets] against the body when it was kept [m]
    std::vector<Grip> grips_;    // of the facets that touched then, by facet
    std::vector<Touch> pushed_;  // the last push
    double dissipated_ = 0.0;    // until then [J]
    bool in_steps_ = false;      // in motion: forces work over whole time steps
    double sliding_now_ = 0.0;   // by the last push since then [J]
};

}  // namespace crampfit
