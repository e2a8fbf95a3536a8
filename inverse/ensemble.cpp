#include "inverse/ensemble.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>
#include <random>

namespace crampfit {
namespace {

constexpr double stretch = 2.0;  // a of Goodman and Weare
constexpr double impossible = -std::numeric_limits<double>::infinity();
// A walker does not begin where it is less likely than the best one by more, in ln of the likelihood, than one in ten million is
// for each parameter that is told (normal): from there hardly any stretch leads back. So many halvings of its way from the
// centre.
constexpr double far_below = 15.0;
constexpr int most_halvings = 20;

struct Walker {
    Run run;
    double log_likelihood = impossible;
};

/// The walkers and the dice.
class Sampler {
  public:
    Sampler(Objective& objective, const std::function<double(const Evaluation&)>& log_likelihood, unsigned seed)
        : objective_(objective), log_likelihood_(log_likelihood), generator_(seed) {}

    // Walkers about the centre; false when the runs ended before all were there.
    bool begin(const Eigen::VectorXd& centre, const Eigen::MatrixXd& covariance, int walkers) {
        const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> axes(covariance);
        const Eigen::MatrixXd root = axes.eigenvectors() * axes.eigenvalues().cwiseMax(0.0).cwiseSqrt().asDiagonal();
        std::vector<Eigen::VectorXd> points;
        for (int k = 0; k < walkers; ++k) {
            points.push_back(point_about(centre, root));
        }
        std::vector<std::size_t> away(points.size());  // walkers that have no place yet
        std::iota(away.begin(), away.end(), 0);
        walkers_.resize(points.size());
        for (int halving = 0; halving <= most_halvings && !away.empty(); ++halving) {
            std::vector<Eigen::VectorXd> tried;
            for (const std::size_t k : away) {
                tried.push_back(points[k]);
            }
            const auto evaluations = objective_.at(tried);
            for (std::size_t i = 0; i < away.size(); ++i) {
                if (!evaluations[i]) {
                    return false;
                }
                walkers_[away[i]] = {{tried[i], evaluations[i]}, log_likelihood_of(*evaluations[i])};
            }
            const double best = std::ranges::max(walkers_, {}, &Walker::log_likelihood).log_likelihood;
            const double least = best - far_below * static_cast<double>(centre.size());
            away.clear();
            for (std::size_t k = 0; k < points.size(); ++k) {
                if (walkers_[k].log_likelihood < least) {
                    away.push_back(k);
                    points[k] = 0.5 * (points[k] + centre);
                }
            }
        }
        return true;
    }

    // Both halves once; false when the runs ended before.
    bool sweep() {
        const std::size_t half = walkers_.size() / 2;
        return move(0, half) && move(half, 0);
    }

    const std::vector<Walker>& walkers() const { return walkers_; }
    double acceptance() const { return static_cast<double>(accepted_) / static_cast<double>(std::max(1L, tried_)); }

  private:
    double uniform() { return (static_cast<double>(generator_()) + 0.5) / 4294967296.0; }  // 2^32
    double normal() {                                                                      // Box and Muller (1958)
        return std::sqrt(-2 * std::log(uniform())) * std::cos(2 * std::numbers::pi * uniform());
    }

    double log_likelihood_of(const Evaluation& evaluation) const {
        return evaluation.usable() ? log_likelihood_(evaluation) : impossible;
    }

    // Within the cube: drawn anew as long as it is not, and pushed back in where that does not help.
    Eigen::VectorXd point_about(const Eigen::VectorXd& centre, const Eigen::MatrixXd& root) {
        constexpr int most_draws = 100;
        constexpr double inside = 1e-6;
        Eigen::VectorXd point;
        for (int i = 0; i < most_draws; ++i) {
            Eigen::VectorXd z(centre.size());
            for (double& value : z) {
                value = normal();
            }
            point = centre + root * z;
            if ((point.array() > 0).all() && (point.array() < 1).all()) {
                return point;
            }
        }
        return point.cwiseMax(inside).cwiseMin(1 - inside);
    }

    // Each walker of one half goes toward or away from one of the other half, drawn at random.
    bool move(std::size_t begin, std::size_t others) {
        const std::size_t half = walkers_.size() / 2;
        std::vector<Eigen::VectorXd> points;
        std::vector<double> z, lots;
        for (std::size_t k = begin; k < begin + half; ++k) {
            const auto& other = walkers_[others + static_cast<std::size_t>(uniform() * static_cast<double>(half))].run.x;
            z.push_back(std::pow((stretch - 1) * uniform() + 1, 2) / stretch);  // density 1 / sqrt(z) over [1/a, a]
            lots.push_back(std::log(uniform()));
            points.push_back(other + z.back() * (walkers_[k].run.x - other));
        }
        std::vector<Eigen::VectorXd> inside;
        for (const Eigen::VectorXd& point : points) {
            if ((point.array() >= 0).all() && (point.array() <= 1).all()) {
                inside.push_back(point);
            }
        }
        const auto evaluations = objective_.at(inside);
        std::size_t next = 0;
        for (std::size_t i = 0; i < half; ++i) {
            ++tried_;
            if (next == inside.size() || points[i] != inside[next]) {
                continue;  // outside the cube
            }
            const auto there = evaluations[next++];
            if (!there) {
                return false;
            }
            Walker& walker = walkers_[begin + i];
            const double log_likelihood = log_likelihood_of(*there);
            const auto power = static_cast<double>(points[i].size() - 1);
            if (lots[i] < power * std::log(z[i]) + log_likelihood - walker.log_likelihood) {
                walker = {{points[i], there}, log_likelihood};
                ++accepted_;
            }
        }
        return true;
    }

    Objective& objective_;
    const std::function<double(const Evaluation&)>& log_likelihood_;
    std::mt19937 generator_;
    std::vector<Walker> walkers_;
    long tried_ = 0;
    long accepted_ = 0;
};

// Integrated autocorrelation time of series of which all have one mean, over the window that is five times as long: Goodman and
// Weare (2010), section 3, after Sokal. `variance`: of each.
double correlation_time(const std::vector<std::vector<double>>& series, double mean, double variance) {
    const std::size_t n = series.front().size();
    const auto covariance = [&](std::size_t lag) {
        double sum = 0;
        for (const std::vector<double>& values : series) {
            for (std::size_t i = 0; i + lag < n; ++i) {
                sum += (values[i] - mean) * (values[i + lag] - mean);
            }
        }
        return sum / static_cast<double>(series.size() * (n - lag));
    };
    double time = 1;
    for (std::size_t lag = 1; variance > 0 && lag < n && static_cast<double>(lag) < 5 * time; ++lag) {
        time += 2 * covariance(lag) / variance;
    }
    return std::max(1.0, time);
}

// Of the mean of all walkers, [walkers][sweeps]. A chain that is short against it shows too little of it by that mean, which
// hardly moves, and enough by the walkers one by one, which do not know how they follow each other: the longer of both.
double correlation_time(const std::vector<std::vector<double>>& walkers) {
    const auto count = static_cast<double>(walkers.size());
    const std::size_t n = walkers.front().size();
    std::vector<double> means(n, 0.0);
    double mean = 0, variance = 0;
    for (const std::vector<double>& values : walkers) {
        for (std::size_t i = 0; i < n; ++i) {
            means[i] += values[i] / count;
            mean += values[i] / (count * static_cast<double>(n));
        }
    }
    for (const std::vector<double>& values : walkers) {
        for (const double value : values) {
            variance += (value - mean) * (value - mean) / (count * static_cast<double>(n));
        }
    }
    return std::max(correlation_time({means}, mean, variance / count), correlation_time(walkers, mean, variance));
}

}  // namespace

Ensemble draw_ensemble(Objective& objective, const std::function<double(const Evaluation&)>& log_likelihood,
                       const Eigen::VectorXd& centre, const Eigen::MatrixXd& covariance, int samples, unsigned seed) {
    const int p = static_cast<int>(centre.size());
    const int walkers = std::max(20, 2 * (p + 1));
    const int sweeps = (samples + walkers - 1) / walkers;
    const int left_out = std::max(50, sweeps / 3);
    Sampler sampler(objective, log_likelihood, seed);
    Ensemble ensemble;
    std::vector<std::vector<std::vector<double>>> drawn(  // [parameters][walkers][sweeps]
        static_cast<std::size_t>(p), std::vector<std::vector<double>>(static_cast<std::size_t>(walkers)));
    bool goes_on = sampler.begin(centre, covariance, walkers);
    for (int i = 0; i < left_out + sweeps && goes_on; ++i) {
        goes_on = sampler.sweep();
        if (i < left_out || !goes_on) {
            continue;
        }
        for (std::size_t k = 0; k < sampler.walkers().size(); ++k) {
            const Walker& walker = sampler.walkers()[k];
            for (int j = 0; j < p; ++j) {
                drawn[static_cast<std::size_t>(j)][k].push_back(walker.run.x[j]);
            }
            if (static_cast<int>(ensemble.samples.size()) < samples && walker.run.evaluation->usable()) {
                ensemble.samples.push_back(walker.run);
            }
        }
    }
    ensemble.acceptance = sampler.acceptance();
    ensemble.sweeps = static_cast<int>(drawn.front().front().size());
    ensemble.correlation_time.resize(p);
    for (int j = 0; j < p; ++j) {
        ensemble.correlation_time[j] = correlation_time(drawn[static_cast<std::size_t>(j)]);
    }
    return ensemble;
}

}  // namespace crampfit
