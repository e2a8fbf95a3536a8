#include "inverse/uncertainty.hpp"

#include "inverse/directions.hpp"

#include <Eigen/Cholesky>
#include <Eigen/QR>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <numbers>

namespace crampfit {
namespace {

// 1 + 2 sum rho_k, rho_k the autocorrelation of residuals at distance k, up to the first that chance explains.
double correlation_time(const Eigen::VectorXd& r) {
    const Eigen::Index n = r.size();
    const double chance = 1.64 / std::sqrt(static_cast<double>(n));
    double time = 1;
    for (Eigen::Index k = 1; k < n / 2; ++k) {
        const double rho = r.head(n - k).dot(r.tail(n - k)) / r.squaredNorm();
        if (!(rho > chance)) {
            break;
        }
        time += 2 * rho;
    }
    return time;
}

Eigen::VectorXd weights_of(const MeasuredCurves& curves) {
    std::vector<double> weights;
    for (std::size_t i = 0; i < curves.lengths.size(); ++i) {
        weights.insert(weights.end(), static_cast<std::size_t>(curves.lengths[i]), curves.root(i) * curves.root(i));
    }
    return Eigen::Map<Eigen::VectorXd>(weights.data(), static_cast<Eigen::Index>(weights.size()));
}

// How much a measurement has to say, on average by what it says: 1 where all weights are.
double mean_weight(const Eigen::VectorXd& weights) { return weights.size() > 0 ? weights.squaredNorm() / weights.sum() : 1.0; }

/// Names what cannot be told, and remembers whose intervals are the whole box for it.
class Undetermined {
  public:
    Undetermined(const std::vector<std::string>& names, const Window& window)
        : names_(names), window_(window), is_member_(names.size(), false) {}

    // Returns how far that goes in the box, at the most of its parameters.
    double add(const Eigen::VectorXd& of_window) {
        const Eigen::VectorXd direction = window_.axes * of_window;
        std::vector<std::string> members;
        std::vector<Eigen::Index> parameters;
        for (std::size_t j = 0; j < names_.size(); ++j) {
            if (std::abs(direction[static_cast<Eigen::Index>(j)]) > 0.1 * direction.cwiseAbs().maxCoeff()) {
                members.push_back("'" + names_[j] + "'");
                parameters.push_back(static_cast<Eigen::Index>(j));
                is_member_[j] = true;
            }
        }
        const std::string sentence =
            members.size() == 1 ? members.front() + " cannot be told from this data: any value in its interval would do. "
                                : fmt::format("{} cannot be told apart by this data. ", fmt::join(members, " and "));
        const auto is_same = [&](const Untold& other) { return other.sentence == sentence; };
        if (std::none_of(untold_.begin(), untold_.end(), is_same)) {  // several directions may be made of the same parameters
            untold_.push_back({parameters, sentence, direction / direction.cwiseAbs().maxCoeff()});
        }
        return direction.cwiseAbs().maxCoeff();
    }

    bool contains(Eigen::Index j) const { return is_member_[static_cast<std::size_t>(j)]; }
    const std::vector<Untold>& untold() const { return untold_; }

  private:
    const std::vector<std::string>& names_;
    const Window& window_;
    std::vector<bool> is_member_;
    std::vector<Untold> untold_;
};

// What the data leave at the lowest point without priors, in standard deviations: what a prior pulls off the data is no lack of
// fit. At the lowest point the data pull back as much as the priors pull, so that these alone tell how far it is.
Eigen::VectorXd left_by_data(const Directions& directions, const Eigen::VectorXd& weights) {
    const Eigen::Index data = weights.size(), priors = directions.slope.rows() - data;
    const Eigen::VectorXd& all = directions.best.evaluation->residuals;
    Eigen::VectorXd left = all.head(data);
    if (priors > 0) {
        const Eigen::MatrixXd slope = directions.slope.topRows(data);
        const Eigen::VectorXd pull = directions.slope.bottomRows(priors).transpose() * all.tail(priors);
        const Eigen::VectorXd way = (slope.transpose() * slope).completeOrthogonalDecomposition().solve(pull);
        const Eigen::VectorXd there = left + directions.model.jacobian().topRows(data) * way;
        if (there.squaredNorm() < left.squaredNorm()) {  // as where the slope holds so far
            left = there;
        }
    }
    return left.cwiseQuotient(weights.cwiseSqrt());
}

// What data and priors know of the best point in the parameters' units of a window.
struct Knowledge {
    Eigen::MatrixXd covariance;  // told + that of what cannot be told
    Eigen::MatrixXd told;        // the first term of covariance
    Eigen::MatrixXd curvature;   // inverse of that of half the misfit: (J^T W J + c P)^-1
};

// By directions; an undetermined one gets the variance of a uniform distribution over the box.
Knowledge knowledge(const Directions& directions, const Eigen::VectorXd& weights, double widening, Undetermined& undetermined) {
    const Eigen::Index p = directions.scale.size(), data = weights.size(), priors = directions.slope.rows() - data;
    const Eigen::MatrixXd scaled = directions.slope * directions.scale.asDiagonal() * directions.v;  // by directions
    const Eigen::MatrixXd of_data = scaled.topRows(data), of_priors = scaled.bottomRows(priors);
    const Eigen::MatrixXd weighted = weights.cwiseSqrt().asDiagonal() * of_data;
    const double prior_weight = mean_weight(weights);
    const Eigen::MatrixXd nothing = Eigen::MatrixXd::Zero(p, p);
    Knowledge known{nothing, nothing, nothing};
    std::vector<Eigen::Index> told;
    for (Eigen::Index k = 0; k < p; ++k) {
        const Eigen::VectorXd direction = directions.scale.cwiseProduct(directions.v.col(k));
        const double largest = direction.cwiseAbs().maxCoeff();
        const double bend = of_data.col(k).squaredNorm() + of_priors.col(k).squaredNorm();
        const double noise = widening * weighted.col(k).squaredNorm() + prior_weight * of_priors.col(k).squaredNorm();
        if (directions.resolved(k) && 4 * largest * std::sqrt(noise) < bend) {
            told.push_back(k);
        } else {
            const double width = std::max(largest, undetermined.add(direction));  // no wider than the box
            known.covariance += direction * direction.transpose() / (12 * width * width);
        }
    }
    if (!told.empty()) {
        const Eigen::MatrixXd a = of_data(Eigen::all, told).transpose() * of_data(Eigen::all, told);          // J^T W J
        const Eigen::MatrixXd b = weighted(Eigen::all, told).transpose() * weighted(Eigen::all, told);        // J^T W^2 J
        const Eigen::MatrixXd prior = of_priors(Eigen::all, told).transpose() * of_priors(Eigen::all, told);  // c P
        const Eigen::MatrixXd bend = a + prior;
        const Eigen::MatrixXd inverse = bend.ldlt().solve(Eigen::MatrixXd::Identity(bend.rows(), bend.cols()));
        const Eigen::MatrixXd way = directions.scale.asDiagonal() * directions.v(Eigen::all, told);
        known.told = way * inverse * (widening * b + prior_weight * prior) * inverse * way.transpose();
        known.covariance += known.told;
        known.curvature = way * inverse * way.transpose();
    }
    return known;
}

// How the model's noise moves the best run: by each run's scatter, and off the lowest point of the polynomial.
Eigen::MatrixXd model_covariance(const Directions& directions) {
    const Eigen::Index p = directions.scale.size();
    const LocalModel& model = directions.model;
    Eigen::VectorXd off = lowest_point(model, directions.best.x, 1.5 * directions.radius) - directions.best.x;
    for (Eigen::Index j = 0; j < p; ++j) {
        off[j] = directions.slope.col(j).isZero(0.0) ? 0.0 : off[j];  // it lies anywhere
    }
    Eigen::MatrixXd covariance = off * off.transpose();
    if (model.freedom() > 0) {
        Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(p, model.scatter().cols());
        for (Eigen::Index k = 0; k < p; ++k) {
            if (directions.resolved(k)) {
                moved += directions.scale.cwiseProduct(directions.v.col(k)) *
                         (directions.u.col(k).transpose() * directions.weight.asDiagonal() * model.scatter()) /
                         directions.singular[k];
            }
        }
        covariance += moved * moved.transpose() / model.freedom();
    }
    return covariance;
}

// J with the columns, too, that a few stations beside a jump hide by their scatter and the others tell: by more than two standard
// errors in the mean (root mean square) of those that they move.
Eigen::MatrixXd slope_beside_jumps(const Directions& directions) {
    constexpr double least = 1e-3, plain = 2, most = 10;  // sigmas that a window moves a station by; standard errors
    const Eigen::MatrixXd jacobian = directions.model.jacobian(), error = directions.model.jacobian_errors();
    Eigen::MatrixXd slope = Eigen::MatrixXd::Zero(jacobian.rows(), jacobian.cols());
    for (Eigen::Index j = 0; j < slope.cols(); ++j) {
        double squares = 0, moved = 0;
        for (Eigen::Index row = 0; row < slope.rows(); ++row) {
            if (std::abs(jacobian(row, j)) > least) {
                squares += std::min(most * most, std::pow(jacobian(row, j) / std::max(error(row, j), least / most), 2));
                ++moved;
            }
        }
        if (!directions.slope.col(j).isZero(0.0) || squares > plain * plain * moved) {
            slope.col(j) = jacobian.col(j);
        }
    }
    return slope;
}

}  // namespace

double correlation_time(const Eigen::VectorXd& residuals, const std::vector<int>& curve_lengths) {
    double sum = 0;
    Eigen::Index begin = 0;
    for (const int length : curve_lengths) {
        sum += length * correlation_time(residuals.segment(begin, length));
        begin += length;
    }
    return begin > 0 ? sum / static_cast<double>(begin) : 1.0;
}

double student_975(int degrees_of_freedom) {
    // Abramowitz and Stegun (1964), 26.7.3 and 26.7.4: P(|T| < t) as a finite sum in cos(theta), theta = atan(t /
    // sqrt(n)).
    const int n = degrees_of_freedom;
    const auto inside = [n](double t) {
        const double theta = std::atan(t / std::sqrt(n));
        const double cosine = std::cos(theta);
        const bool odd = n % 2 == 1;
        double term = odd ? cosine : 1.0;
        double sum = n > 1 ? term : 0.0;
        for (int k = odd ? 3 : 2; k < n - 1; k += 2) {
            term *= cosine * cosine * (k - 1) / k;
            sum += term;
        }
        return odd ? 2 / std::numbers::pi * (theta + std::sin(theta) * sum) : std::sin(theta) * sum;
    };
    double low = 1.9, high = 13.0;  // from the normal distribution to one degree of freedom
    while (high - low > 1e-9) {
        const double middle = 0.5 * (low + high);
        (inside(middle) < 0.95 ? low : high) = middle;
    }
    return 0.5 * (low + high);
}

Uncertainty estimate_uncertainty(Objective& objective, const MeasuredCurves& curves, const std::vector<std::string>& names,
                                 double step, const Window& window) {
    const auto directions = directions_about_best(objective, step);
    Uncertainty result;
    result.best = *objective.best();
    result.best.x = window.inside(result.best.x);
    const Eigen::VectorXd& x = result.best.x;
    const Eigen::VectorXd weights = weights_of(curves);
    const int p = static_cast<int>(x.size());
    const int count = static_cast<int>(weights.size());
    const Eigen::VectorXd residuals = result.best.evaluation->residuals.head(count).cwiseQuotient(weights.cwiseSqrt());
    result.reduced_chi_square = residuals.squaredNorm() / std::max(1, count - p);
    result.lower_95 = Eigen::VectorXd::Zero(p);
    result.upper_95 = Eigen::VectorXd::Ones(p);
    if (!directions) {
        result.covariance = Eigen::MatrixXd::Identity(p, p) / 12.0;
        result.message = "Too few runs ended well near the best one to tell how sure it is: the intervals are the whole box. ";
        return result;
    }
    const Eigen::VectorXd left = left_by_data(*directions, weights);
    const double chi_square = left.squaredNorm() / std::max(1, count - p);
    const double time = correlation_time(left, curves.lengths);
    const double widening = std::max(1.0, chi_square * time);
    int independent = count;
    if (widening > 1) {
        independent = static_cast<int>(count / time);
        result.message += fmt::format("Standard errors are widened by {:.3g}: the misfit is {:.3g} times what the "
                                      "noise explains, and {:.3g} neighbouring "
                                      "residuals count as one. ",
                                      std::sqrt(widening), chi_square, time);
    }
    Undetermined undetermined(names, window);
    const auto in_box = [&](const Eigen::MatrixXd& covariance) -> Eigen::MatrixXd {
        return window.axes * covariance * window.axes.transpose();
    };
    const Eigen::MatrixXd own = in_box(model_covariance(*directions));
    const Knowledge known = knowledge(*directions, weights, widening, undetermined);
    result.covariance = in_box(known.covariance) + own;
    result.widening = widening;
    result.prior_weight = mean_weight(weights);
    result.temperature = widening * result.prior_weight;
    result.model_variance = own.diagonal();
    result.slope = slope_beside_jumps(*directions) * window.axes.inverse();
    result.untold = undetermined.untold();
    for (const Untold& direction : result.untold) {
        result.message += direction.sentence;
    }
    const double share = (own.diagonal().array() / result.covariance.diagonal().array()).maxCoeff();
    if (share > 0.1) {
        result.message += fmt::format("The model's own scatter from run to run, and the best run's distance from the lowest "
                                      "point of the fit through its neighbours, make up to {:.0f} % of a variance. ",
                                      100 * share);
    }
    const double t = student_975(std::max(1, independent - p));
    result.quantile = t;
    result.rise = Eigen::VectorXd::Constant(p, t * t * result.temperature);
    const Eigen::MatrixXd spread = in_box(known.told), curvature = in_box(known.curvature);
    for (Eigen::Index j = 0; j < p; ++j) {
        if (!undetermined.contains(j)) {
            result.rise[j] = t * t * spread(j, j) / curvature(j, j);
            const double half = t * std::sqrt(result.covariance(j, j));
            result.lower_95[j] = std::max(0.0, x[j] - half);
            result.upper_95[j] = std::min(1.0, x[j] + half);
        }
    }
    return result;
}

}  // namespace crampfit
