#include "inverse/walk_slopes.hpp"

namespace crampfit {
namespace {

// Of the value, or of the box where the value may be zero: rounding takes some 1e-10 of a derivative, curvature 1e-6.
constexpr double step = 1e-6;

}  // namespace

std::optional<WalkSlopes> walk_slopes(const std::function<Evaluation(const Eigen::VectorXd&)>& near,
                                      const Eigen::VectorXd& values, const std::vector<Parameter>& parameters) {
    const Evaluation here = near(values);
    if (!here.usable()) {
        return std::nullopt;
    }
    const Eigen::Index p = values.size();
    WalkSlopes slopes{Eigen::MatrixXd(here.residuals.size(), p), Eigen::MatrixXd(here.residuals.size(), p)};
    for (Eigen::Index j = 0; j < p; ++j) {
        const Parameter& parameter = parameters[static_cast<std::size_t>(j)];
        const double width = parameter.scale == Scale::logarithmic ? values[j] : parameter.upper - parameter.lower;
        Eigen::VectorXd below = values, above = values;
        below[j] -= step * width;
        above[j] += step * width;
        const Evaluation less = near(below), more = near(above);
        if (!less.usable() || !more.usable()) {
            return std::nullopt;
        }
        slopes.from_below.col(j) = (here.residuals - less.residuals) / (values[j] - below[j]);
        slopes.from_above.col(j) = (more.residuals - here.residuals) / (above[j] - values[j]);
    }
    return slopes;
}

}  // namespace crampfit
