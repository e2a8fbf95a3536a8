#include "inverse/directions.hpp"

#include "inverse/differences.hpp"

#include <Eigen/SVD>

#include <algorithm>

namespace crampfit {
namespace {

// Below this, next to the largest singular value of J with columns of length one, the curvature of the model within a
// difference makes a value that is zero look like something.
constexpr double resolution = 1e-3;

Directions take_apart(const Run& best, const LocalModel& model, double radius) {
    const Eigen::MatrixXd jacobian = model.jacobian();
    Directions result{best, model, radius, {}, {}, {}, {}, {}};
    // A parameter without any effect keeps a column of zeros.
    result.scale = jacobian.colwise().norm().unaryExpr([](double length) { return length > 0 ? 1 / length : 1.0; });
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(jacobian * result.scale.asDiagonal(), Eigen::ComputeThinU | Eigen::ComputeThinV);
    result.singular = svd.singularValues();
    result.u = svd.matrixU();
    result.v = svd.matrixV();
    const Eigen::VectorXd column_error = model.jacobian_error().cwiseProduct(result.scale);
    result.error = (column_error.asDiagonal() * result.v).colwise().norm();
    return result;
}

}  // namespace

bool Directions::resolved(Eigen::Index k) const { return singular[k] > std::max(resolution * singular[0], 2 * error[k]); }

bool Directions::all_resolved() const {
    for (Eigen::Index k = 0; k < singular.size(); ++k) {
        if (!resolved(k)) {
            return false;
        }
    }
    return true;
}

std::optional<Directions> directions_about_best(Objective& objective, double step) {
    std::optional<Directions> found;
    double radius = step;
    while (radius <= 4 * step) {
        const Run best = *objective.best();
        objective.at(stencil(best.x, radius));
        if (objective.best()->x != best.x) {
            radius = step;  // a better run: about that one, then
            found.reset();
            continue;
        }
        if (const auto model = LocalModel::fit(objective.runs(), best.x, 1.5 * radius)) {
            found = take_apart(best, *model, radius);
            if (found->all_resolved()) {
                return found;
            }
        }
        radius *= 2;
    }
    return found;
}

}  // namespace crampfit
