// What keeps a specimen that nothing or hardly anything holds: springs in the tangent and in no force, places that stay.
#include "forward/equilibrium.hpp"
#include "forward/loading.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ranges>
#include <utility>

namespace crampfit {

// Where the last tangent cannot be solved for, as a piece between cracks hangs by a hinge, a ligament that does not resist
// bending: a spring at one unknown of what moves without any force. No load is on it, as it is no part of the forces.
bool Equilibrium::hold_hinge() {
    if (!sliding_.empty() || cracks_.lines.empty() || equations_ == 0) return false;
    if (find_loose_pieces(body_, cracks_, boundary_, mass_).holds.size() > pieces_.holds.size())
        return false;  // hangs by nothing
    const auto dof = std::ranges::find(equation_, factor_.weakest());
    hinges_.push_back(static_cast<int>(dof - equation_.begin()));
    factor_.mark_all();
    return true;
}

void Equilibrium::drop_hinges() {
    if (!std::exchange(hinges_, {}).empty()) factor_.mark_all();
}

void Equilibrium::add_hinges() {
    for (const int dof : hinges_) {
        Eigen::Matrix<double, 8, 8> stiffness = Eigen::Matrix<double, 8, 8>::Zero();
        stiffness(dof % 2, dof % 2) = body_.points.stiffest(0) * body_.layout.thickness;
        add_extra(cell_at(cracks_.node_of_field[dof / 2]), std::array{dof / 2, -1, -1, -1}, stiffness);
    }
}

// Along an axis a specimen may slide between bodies without friction that all lie on surfaces along it, as a beam does on its
// rollers: how far is nowhere said, and the grid's last digits would decide it. One place in its middle stays then; and one
// beside it where the specimen may roll too, as a disk does between platens.
void Equilibrium::find_guides() {
    constexpr double most_aslant = 0.15;  // of a surface, sine
    constexpr double near = 0.02;         // in cells: on a disk of ten cells' radius a sixteenth of that to either side
    constexpr double narrow = 0.2;        // of the specimen
    for (int axis = 0; axis < 2; ++axis) {
        if (sliding_.empty() || !slides_along(scene_, axis)) continue;
        const double far = std::numeric_limits<double>::infinity();
        double low = far, high = -far;  // where bodies touch it
        bool lie_along = true;
        for (std::size_t i = 0; i < sliding_.size(); ++i) {
            const Box at_start = bounds(sliding_[i].shape());
            const Vec2 travel = boundary_.travel(sliding_driver_[i], std::min(plan_.end_time, plan_.still_from));
            const Box way{at_start.low.cwiseMin(at_start.low + travel), at_start.high.cwiseMax(at_start.high + travel)};
            const auto reaches = [&](const Crack& crack) {  // it may come to press on its faces
                return std::ranges::any_of(crack.points, [&](const Vec2& point) { return way.contains(point); });
            };
            if (std::ranges::any_of(scene_.cracks, reaches)) lie_along = false;
            const std::vector<const Facet*> facets = sliding_[i].nearest_facets(near * body_.layout.cell.minCoeff());
            const auto is_aslant = [&](const Facet* facet) { return std::abs(facet->normal[axis]) > most_aslant; };
            if (is_aslant(facets.front())) lie_along = false;
            for (const Facet* facet : facets) {
                if (is_aslant(facet)) continue;  // of the next side
                low = std::min(low, facet->position[axis]);
                high = std::max(high, facet->position[axis]);
            }
        }
        if (!lie_along) continue;
        const Vec2 size = body_.layout.size();
        Vec2 place = 0.5 * size;
        guides_.push_back(2 * field_near(place) + axis);
        if (high - low > narrow * size[axis]) continue;
        place[1 - axis] += 0.25 * size[1 - axis];
        guides_.push_back(2 * field_near(place) + axis);
    }
}

// With wood.
int Equilibrium::field_near(const Vec2& place) const {
    const auto distance = [&](int field) {
        const double from = (body_.layout.node_position(cracks_.node_of_field[field]) - place).norm();
        return mass_[field] > 0.0 ? from : std::numeric_limits<double>::infinity();
    };
    return std::ranges::min(std::views::iota(0, cracks_.fields()), {}, distance);
}

// A specimen that bodies are to hold, none of which presses yet, goes to them by steps with a tangent that weak springs hold. No
// load is on these either.
void Equilibrium::set_loose(bool loose) {
    if (std::exchange(loose_, loose) != loose) factor_.mark_all();
}

// Whether most of the specimen moves with this unknown without any force: then it is held too little.
bool Equilibrium::moves_most(int hinge) const {
    constexpr double moves = 1e-3, most_mass = 0.5;  // of the largest motion; of the specimen
    Eigen::MatrixXd mode = Eigen::MatrixXd::Zero(equations_, 1);
    mode(equation_[hinge], 0) = 1.0;
    factor_.solve(mode);
    const double largest = mode.cwiseAbs().maxCoeff();
    double moved = 0.0, all = 0.0;
    for (int dof = 0; dof < static_cast<int>(equation_.size()); ++dof) {
        all += mass_[dof / 2];
        if (equation_[dof] >= 0 && std::abs(mode(equation_[dof], 0)) > moves * largest) moved += mass_[dof / 2];
    }
    return moved > most_mass * all;
}

}  // namespace crampfit
