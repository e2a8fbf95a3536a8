#pragma once

#include "forward/discretisation.hpp"
#include "forward/memory_law.hpp"

#include <vector>

namespace crampfit {

struct EnergyReleaseOptions;
struct TipLoad;

/// What points of wood that remembers have been through; no others have a row here. Where several woods lie in a cell they act as
/// layers there, as elastic wood does: with n the normal of the layers, strains of two layers differ by the symmetric part of a
/// (x) n, with the a that makes the tractions on the boundary between them the same. Each layer has a memory of its own.
///
/// A step begins with `go_to`; `respond` may be called any number of times, from several threads for different points; `settle`
/// ends it.
class History {
  public:
    History(const MaterialMap& materials, const Discretisation& body, PlaneCondition plane);

    bool is_in(int cell) const { return cell_[cell] >= 0; }
    bool flows_in_plane(int cell) const {
        return is_in(cell) && woods_[cell_[cell]].flows;
    }  // some of it is plastic, in plane strain
    int cells() const { return static_cast<int>(woods_.size()); }
    std::size_t bytes() const { return 2 * sizeof(double) * before_.size(); }

    /// G and K take the wood for elastic. Where some of that about a tip remembers, they become not a number.
    void forget_unknown(TipLoad& load, const Vec2& tip, const EnergyReleaseOptions& options) const;

    /// The end of the step from the time of the last one that was settled [s].
    void go_to(double time);

    /// Stress xx, yy, xy and tangent of a point with strain xx, yy, 2 xy at the end of the step.
    PlaneResponse respond(int point, const Eigen::Vector3d& strain);

    /// What the last responses of all points led to is what they remember.
    void settle();

    // Of what was settled, with the strain as it was then.
    Tensor stress(int point, const Eigen::Vector3d& strain) const;  // [Pa]
    double stored(int point, const Eigen::Vector3d& strain) const;  // [J/m^3]
    double dissipated() const;                                      // by all points since the start [J]

    struct State {
        double time = 0.0;           // [s]
        std::vector<double> values;  // empty: nothing has happened yet
    };
    State save() const { return {time_, before_}; }
    void restore(const State& state);

  private:
    struct Layer {
        int law;                  // its number; -1: elastic
        double share;             // of the wood in the cell
        double rest;              // what part of this layer and those after it it is
        int first;                // of its values in a point's row
        int jump;                 // of a against the layers after it there; only where there are any
        Eigen::Matrix3d elastic;  // stiffness [Pa]
        double poisson_ratio;
    };
    struct Wood {  // of a cell
        int cell;
        std::vector<Layer> layers;
        Vec2 normal;
        int row;  // values a point
        bool flows;
        std::size_t first;  // of them
    };
    const Wood& wood_of(int point) const { return woods_[cell_[body_.points.cell[point]]]; }
    std::size_t row_of(int point) const {
        const Wood& wood = wood_of(point);
        return wood.first + static_cast<std::size_t>(point - body_.points.first_of_cell[wood.cell]) * wood.row;
    }
    void add_wood(const MaterialMap& materials, const std::vector<int>& laws, PlaneCondition plane, int cell);
    PlaneResponse respond(const Wood& wood, std::size_t layer, const Eigen::Vector3d& strain, const double* before,
                          double* now) const;
    PlaneResponse respond(const Layer& layer, const Eigen::Vector3d& strain, const double* before, double* now) const;
    template <class Visit>
    void for_layers(int point, const Eigen::Vector3d& strain, const Visit& visit) const;

    const Discretisation& body_;
    bool plane_strain_;
    std::vector<MemoryLaw> laws_;
    std::vector<int> cell_;  // [cells] its wood, or -1
    std::vector<Wood> woods_;
    std::vector<double> before_;  // as settled
    std::vector<double> now_;
    double time_ = 0.0;       // [s]
    double next_time_ = 0.0;  // [s]
};

}  // namespace crampfit
