#include "inverse/local_model.hpp"

#include "inverse/minimize.hpp"

#include <Eigen/QR>

#include <algorithm>
#include <cmath>

namespace crampfit {

Eigen::VectorXd LocalModel::terms(const Eigen::VectorXd& x) const {
    const Eigen::VectorXd d = (x - centre_) / reach_;
    std::vector<double> values{1.0};
    values.insert(values.end(), d.begin(), d.end());
    if (order_ != Order::linear) {
        for (Eigen::Index i = 0; i < d.size(); ++i) {
            values.push_back(d[i] * d[i]);
        }
    }
    if (order_ == Order::full) {
        for (Eigen::Index i = 0; i < d.size(); ++i) {
            for (Eigen::Index j = i + 1; j < d.size(); ++j) {
                values.push_back(d[i] * d[j]);
            }
        }
    }
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
}

std::optional<LocalModel> LocalModel::fit(const std::vector<Run>& near, const Eigen::VectorXd& centre, double reach,
                                          Order order) {
    LocalModel model;
    model.reach_ = reach;
    model.order_ = order;
    model.centre_ = centre;
    const auto count = static_cast<Eigen::Index>(near.size());
    const Eigen::Index terms = model.terms(centre).size();
    // A curvature fitted without runs to spare would take the scatter for itself and report none.
    if (count < terms + (order == Order::linear ? 0 : centre.size())) {
        return std::nullopt;
    }
    Eigen::VectorXd weights(count);
    Eigen::MatrixXd design(count, terms);
    Eigen::MatrixXd values(count, near.front().evaluation->residuals.size());
    for (Eigen::Index k = 0; k < count; ++k) {
        const Run& run = near[static_cast<std::size_t>(k)];
        design.row(k) = model.terms(run.x);
        values.row(k) = run.evaluation->residuals;
        // Near runs count more: over the whole reach the truth bends in ways that no polynomial of this order has.
        const double distance = (run.x - centre).cwiseAbs().maxCoeff() / reach;
        weights[k] = 0.2 / (0.2 + distance * distance);
    }
    Eigen::ColPivHouseholderQR<Eigen::MatrixXd> factors(weights.asDiagonal() * design);
    factors.setThreshold(0.02);  // directions that the runs hardly span would be all scatter
    if (factors.rank() < terms) {
        return std::nullopt;
    }
    model.coefficients_ = factors.solve(weights.asDiagonal() * values);
    // Error of a linear fit: the coefficients are P times the values, P the pseudo-inverse; a row of P, squared and
    // summed.
    const Eigen::MatrixXd inverse = factors.solve(Eigen::MatrixXd(weights.asDiagonal()));
    model.slope_error_ = inverse.middleRows(1, centre.size()).rowwise().norm() / reach;
    model.scatter_ = (values - design * model.coefficients_).transpose();
    model.freedom_ = static_cast<int>(count - terms);
    return model;
}

std::optional<LocalModel> LocalModel::fit(std::span<const Run> runs, const Eigen::VectorXd& centre, double reach) {
    std::vector<Run> near;
    std::copy_if(runs.begin(), runs.end(), std::back_inserter(near),
                 [&](const Run& run) { return run.evaluation->usable() && (run.x - centre).cwiseAbs().maxCoeff() <= reach; });
    if (near.empty()) {
        return std::nullopt;
    }
    for (const Order order : {Order::full, Order::squares, Order::linear}) {
        if (auto model = fit(near, centre, reach, order)) {
            return model;
        }
    }
    return std::nullopt;
}

Eigen::VectorXd LocalModel::residuals(const Eigen::VectorXd& x) const { return coefficients_.transpose() * terms(x); }

Eigen::MatrixXd LocalModel::jacobian() const { return coefficients_.middleRows(1, centre_.size()).transpose() / reach_; }

Eigen::VectorXd lowest_point(const LocalModel& model, const Eigen::VectorXd& centre, double radius) {
    const Eigen::VectorXd low = (centre.array() - radius).cwiseMax(0.0);
    const Eigen::VectorXd high = (centre.array() + radius).cwiseMin(1.0);
    const auto place = [&](const Eigen::VectorXd& z) -> Eigen::VectorXd { return low + z.cwiseProduct(high - low); };
    constexpr int evaluations = 10000;  // of polynomials
    Objective surrogate(
        centre.size(),
        [&](const Eigen::VectorXd& z, int) {
            Evaluation evaluation;
            evaluation.residuals = model.residuals(place(z));
            evaluation.misfit = evaluation.residuals.squaredNorm();
            return evaluation;
        },
        evaluations, 1);
    const Eigen::VectorXd start = (centre - low).cwiseQuotient(high - low);
    minimize_with_ceres(surrogate, start);
    return place(surrogate.best()->x);
}

}  // namespace crampfit
