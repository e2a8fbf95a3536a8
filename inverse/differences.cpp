#include "inverse/differences.hpp"

#include <array>

namespace crampfit {
namespace {

// Column j by differences over `step`; absent when neither side could be run.
std::optional<Eigen::VectorXd> column(Objective& objective, const Eigen::VectorXd& x, const Eigen::VectorXd& residuals,
                                      Eigen::Index j, double step) {
    std::array<std::shared_ptr<const Evaluation>, 2> sides;
    std::array<double, 2> offsets{-step, step};
    for (std::size_t k = 0; k < 2; ++k) {
        Eigen::VectorXd point = x;
        point[j] += offsets[k];
        if (point[j] >= 0 && point[j] <= 1) {
            sides[k] = objective.at(point);
        }
        if (sides[k] && !sides[k]->usable()) {
            sides[k] = nullptr;
        }
    }
    if (sides[0] && sides[1]) {
        return (sides[1]->residuals - sides[0]->residuals) / (2 * step);
    }
    for (std::size_t k = 0; k < 2; ++k) {
        if (sides[k]) {
            return (sides[k]->residuals - residuals) / offsets[k];
        }
    }
    return std::nullopt;
}

}  // namespace

std::vector<Eigen::VectorXd> stencil(const Eigen::VectorXd& x, double step) {
    std::vector<Eigen::VectorXd> points;
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        for (const double offset : {-step, step}) {
            Eigen::VectorXd point = x;
            point[j] += offset;
            if (point[j] >= 0 && point[j] <= 1) {
                points.push_back(point);
            }
        }
    }
    return points;
}

std::optional<Eigen::MatrixXd> jacobian(Objective& objective, const Eigen::VectorXd& x) {
    std::vector<Eigen::VectorXd> points = stencil(x);
    points.insert(points.begin(), x);
    const auto here = objective.at(points).front();  // runs all of them side by side; the columns find them in the memo
    if (!here || !here->usable()) {
        return std::nullopt;
    }
    Eigen::MatrixXd result(here->residuals.size(), x.size());
    for (Eigen::Index j = 0; j < x.size(); ++j) {
        auto derivative = column(objective, x, here->residuals, j, difference_step);
        if (!derivative) {
            derivative = column(objective, x, here->residuals, j, 0.5 * difference_step);
        }
        if (!derivative) {
            return std::nullopt;
        }
        result.col(j) = *derivative;
    }
    return result;
}

}  // namespace crampfit
