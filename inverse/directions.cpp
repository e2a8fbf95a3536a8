#include "inverse/directions.hpp"

#include "inverse/differences.hpp"

#include <Eigen/SVD>

#include <algorithm>
#include <vector>

namespace crampfit {
namespace {

// Below this, next to the largest singular value of J with columns of length one, the curvature of the model within a
// difference makes a value that is zero look like something.
constexpr double resolution = 1e-3;

// Next to the longest column: below that a slope is what rounding leaves of none.
constexpr double least_length = 1e-9;

// What of a slope's length no scatter is believed to make, next to the length that its standard errors add up to. That one is of
// a sum of squares, which spreads by sqrt(2 / n) of itself where n residuals scatter each by itself; three of these are taken.
// Where few runs tell, or few residuals scatter, n is small, and by n = 2 a slope must be twice as long as its error.
double least_over_error(const LocalModel& model, const Eigen::VectorXd& weight) {
    const Eigen::MatrixXd scatter = weight.asDiagonal() * model.scatter();
    const Eigen::MatrixXd between_runs = scatter.transpose() * scatter;
    const double squares = between_runs.squaredNorm();
    // Satterthwaite (1946): tr(C)^2 / tr(C^2) of the residuals' covariance C; between runs, both are the same.
    const double n = squares > 0 ? between_runs.trace() * between_runs.trace() / squares : 1.0;
    return std::sqrt(1 + 3 * std::sqrt(2 / n));
}

// Which columns tell their parameter's effect from none. To scale the others to length one would make of their scatter an effect
// as large as any, which no direction that it is mixed into could be told from.
std::vector<Eigen::Index> columns_with_effect(const Eigen::VectorXd& length, const Eigen::VectorXd& error, double least) {
    std::vector<Eigen::Index> columns;
    for (Eigen::Index j = 0; j < length.size(); ++j) {
        if (length[j] > std::max(least_length * length.maxCoeff(), least * error[j])) {
            columns.push_back(j);
        }
    }
    return columns;
}

// Of each residual: as one whose noise of one is outdone by the model's scatter.
Eigen::VectorXd weights_by_scatter(const LocalModel& model) {
    const Eigen::VectorXd scatter = model.scatter().rowwise().norm() / std::sqrt(std::max(1, model.freedom()));
    return scatter.cwiseMax(1.0).cwiseInverse();
}

Directions take_apart(const Run& best, const LocalModel& model, double radius, const Eigen::VectorXd& weight) {
    const Eigen::MatrixXd jacobian = weight.asDiagonal() * model.jacobian();
    const Eigen::Index p = jacobian.cols();
    const Eigen::VectorXd length = jacobian.colwise().norm();
    const Eigen::VectorXd error = (weight.asDiagonal() * model.jacobian_errors()).colwise().norm();
    const double least = least_over_error(model, weight);
    const std::vector<Eigen::Index> told = columns_with_effect(length, error, least);
    const auto count = static_cast<Eigen::Index>(told.size());
    Directions result{best,
                      model,
                      radius,
                      weight,
                      Eigen::MatrixXd::Zero(jacobian.rows(), p),
                      Eigen::VectorXd::Ones(p),
                      Eigen::VectorXd::Zero(p),
                      Eigen::VectorXd::Zero(p),
                      least,
                      Eigen::MatrixXd::Zero(jacobian.rows(), p),
                      Eigen::MatrixXd::Zero(p, p)};
    for (const Eigen::Index j : told) {
        result.slope.col(j) = jacobian.col(j);
        result.scale[j] = 1 / length[j];
    }
    if (count > 0) {
        const Eigen::MatrixXd scaled = result.slope(Eigen::all, told) * result.scale(told).asDiagonal();
        const Eigen::JacobiSVD<Eigen::MatrixXd> svd(scaled, Eigen::ComputeThinU | Eigen::ComputeThinV);
        result.singular.head(count) = svd.singularValues();
        result.u.leftCols(count) = svd.matrixU();
        result.v(told, Eigen::seqN(0, count)) = svd.matrixV();
        const Eigen::VectorXd column_error = error(told).cwiseProduct(result.scale(told));
        result.error.head(count) = (column_error.asDiagonal() * svd.matrixV()).colwise().norm();
    }
    // Each parameter without effect is a direction by itself, with a singular value of zero.
    Eigen::Index next = count;
    for (Eigen::Index j = 0; j < p; ++j) {
        if (std::find(told.begin(), told.end(), j) == told.end()) {
            result.error[next] = length[j] > least_length * length.maxCoeff() ? error[j] : 0.0;
            result.v(j, next++) = 1;
        }
    }
    return result;
}

Directions take_apart(const Run& best, const LocalModel& model, double radius) {
    Directions found = take_apart(best, model, radius, Eigen::VectorXd::Ones(model.scatter().rows()));
    if (!found.wider_would_tell()) {
        return found;
    }
    Directions beside_jumps = take_apart(best, model, radius, weights_by_scatter(model));
    const auto told = [](const Directions& directions) {
        int count = 0;
        for (Eigen::Index k = 0; k < directions.singular.size(); ++k) {
            count += directions.resolved(k);
        }
        return count;
    };
    return told(beside_jumps) > told(found) ? beside_jumps : found;
}

}  // namespace

bool Directions::resolved(Eigen::Index k) const { return singular[k] > std::max(resolution * singular[0], least * error[k]); }

bool Directions::wider_would_tell() const {
    for (Eigen::Index k = 0; k < singular.size(); ++k) {
        const bool has_no_effect = singular[k] == 0 && error[k] == 0;
        if (!resolved(k) && !has_no_effect) {
            return true;
        }
    }
    return false;
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
            if (!found->wider_would_tell()) {
                return found;
            }
        }
        radius *= 2;
    }
    return found;
}

}  // namespace crampfit
