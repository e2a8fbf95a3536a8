// Springs in the tangent, and in no force, for what nothing holds yet or hardly anything does.
#include "forward/equilibrium.hpp"

#include <algorithm>
#include <cmath>
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
