#pragma once

#include "forward/equilibrium.hpp"

#include <memory>
#include <vector>

namespace crampfit {

/// How much more the wood yields under a wheel than the grid says. A wheel touches a few cells, which have one wood each on
/// average and a surface that bends at nodes alone: as it rolls over an edge of latewood, the wedge sample on cells of 0.1 mm is
/// opened 2.5 % too far and G is 5 % too high. So a box about the outline that it may touch is cut out, its sides within the
/// specimen held, and solved for loads along the outline with cells as they are and a quarter as wide. The difference of the
/// yields, short of range (Saint-Venant), goes between wheel and grid as a spring does (local defect correction, Hackbusch 1984).
/// Small strain, without cracks.
///
/// Loads and yields are those of stations along the outline, a fine cell apart, along its normal; linear from one to the next.
/// Modes of the difference in which the grid yields more, as cells may that latewood cuts, are left out: less than nothing in
/// series with the springs, the tangent would not be positive.
class LocalYield {
  public:
    /// Of facets whose middles lie in `where`. Null where these are none, or nothing of the box would be held. `whole`, `plan`,
    /// `wood` and `body` must outlive this.
    static std::shared_ptr<LocalYield> about(const Box& where, const SlidingBody& rigid, const Scene& whole, const Plan& plan,
                                             const MaterialMap& wood, const Discretisation& body);

    static constexpr int finer = 4;  // cells a side in place of one

    struct Place {
        int station;  // its share is 1 - share; that of the next one `share`
        double share;
    };
    bool holds(int facet) const {
        return facet >= first_ && facet < first_ + static_cast<int>(places_.size()) && places_[facet - first_].station >= 0;
    }
    const Place& place(int facet) const { return places_[facet - first_]; }
    int stations() const { return stations_; }

    /// Of stations to forces on them, beyond the grid's [m/N]; symmetric, not negative.
    const Eigen::MatrixXd& yield() const { return yield_; }

    /// How the stations under a wheel answer to it.
    struct Pressed {
        std::vector<int> stations;  // touched, in order
        Eigen::MatrixXd share;      // [touches x stations] of each facet
        Eigen::VectorXd stiffness;  // [touches] of their springs [N/m]
        Eigen::MatrixXd gives;      // [stations x stations] how they yield in series with these; symmetric [m/N]
    };
    Pressed pressed(const std::vector<SlidingBody::Touch>& touches) const;

    /// Finds the slopes of the yield by these numbers, which `slope` asks for: once, and for several wheels side by side.
    void know_slopes(const std::vector<MaterialSlope>& numbers);

    /// Gives back what finds them.
    void forget_slopes();

    /// Slopes by a number of the energy and of the facets' forces, displacements as they are.
    struct Slope {
        double energy = 0;       // that the yield takes [J / unit]
        Eigen::VectorXd forces;  // [touches] [N / unit]
    };

    /// With those of the forces, the yield as it is [touches] [N / unit].
    Slope slope(const std::vector<SlidingBody::Touch>& touches, Eigen::VectorXd forces, const std::vector<MaterialSlope>& numbers,
                std::size_t number);

  private:
    struct Solved;  // the box on one grid
    struct Load {
        int facet, station;
        Vec2 force;  // [N]
    };
    LocalYield() = default;
    std::vector<int> place_stations(const Box& where, const std::vector<Facet>& facets, double pitch);
    std::vector<Load> loads(const std::vector<int>& held, const std::vector<Facet>& facets) const;

    int first_ = 0, stations_ = 0;
    std::vector<Place> places_;   // by facet, from the first on; station -1: not held
    Eigen::MatrixXd modes_;       // [stations x modes] of the difference of the yields
    Eigen::VectorXd mode_yield_;  // [modes] [m/N]
    Eigen::MatrixXd yield_;
    std::vector<Eigen::MatrixXd> slopes_;    // [numbers] of the yield [m/N / unit]; empty: not asked for yet
    std::shared_ptr<Solved> coarse_, fine_;  // null: slopes are known, or will not be asked for
};

}  // namespace crampfit
