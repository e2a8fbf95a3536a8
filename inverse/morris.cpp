#include "inverse/morris.hpp"

#include <cassert>
#include <cmath>
#include <cstdint>
#include <numeric>
#include <random>

namespace crampfit {
namespace {

constexpr int levels = 4;
constexpr double step = 2.0 / 3.0;  // levels / (2 (levels - 1)), so that each level is reached as often

int draw_below(int end, std::mt19937& generator) {
    return static_cast<int>(static_cast<std::uint64_t>(generator()) * static_cast<unsigned>(end) >> 32);
}

double mean(std::span<const int> drawn, const std::vector<double>& values, double (*of)(double)) {
    double sum = 0;
    for (const int i : drawn) {
        sum += of(values[static_cast<std::size_t>(i)]);
    }
    return sum / static_cast<double>(drawn.size());
}

double mean_size(std::span<const int> drawn, const std::vector<double>& effects) {
    return mean(drawn, effects, [](double effect) { return std::abs(effect); });
}

double standard_deviation(std::span<const int> drawn, const std::vector<double>& effects) {
    const double middle = mean(drawn, effects, [](double effect) { return effect; });
    double sum = 0;
    for (const int i : drawn) {
        const double off = effects[static_cast<std::size_t>(i)] - middle;
        sum += off * off;
    }
    return std::sqrt(sum / static_cast<double>(drawn.size() - 1));
}

}  // namespace

MorrisDesign::MorrisDesign(Eigen::Index parameters, int trajectories, unsigned seed)
    : parameters_(parameters), trajectories_(trajectories), seed_(seed) {
    std::mt19937 generator(seed);
    std::vector<Eigen::Index> order(static_cast<std::size_t>(parameters));
    std::iota(order.begin(), order.end(), Eigen::Index{0});
    for (int i = 0; i < trajectories; ++i) {
        Eigen::VectorXd x(parameters);
        for (Eigen::Index j = 0; j < parameters; ++j) {
            x[j] = static_cast<double>(draw_below(levels, generator)) / (levels - 1);
        }
        for (std::size_t k = order.size(); k > 1; --k) {  // Fisher and Yates
            std::swap(order[k - 1], order[static_cast<std::size_t>(draw_below(static_cast<int>(k), generator))]);
        }
        points_.push_back(x);
        for (const Eigen::Index j : order) {
            // Lower half up, upper half down: the way to go is the level's, and all four levels are as likely.
            x[j] += x[j] < 0.5 ? step : -step;
            x[j] = std::round(x[j] * (levels - 1)) / (levels - 1);  // the same bits each time
            points_.push_back(x);
        }
    }
}

MorrisDesign::Measures MorrisDesign::measures(std::span<const double> values) const {
    assert(values.size() == points_.size());
    std::vector<std::vector<double>> effects(static_cast<std::size_t>(parameters_));
    for (std::size_t i = 0; i + 1 < points_.size(); ++i) {
        if ((i + 1) % static_cast<std::size_t>(parameters_ + 1) == 0) {
            continue;  // the next point begins another trajectory
        }
        Eigen::Index moved = 0;
        (points_[i + 1] - points_[i]).cwiseAbs().maxCoeff(&moved);
        const double effect = (values[i + 1] - values[i]) / (points_[i + 1] - points_[i])[moved];
        if (std::isfinite(effect)) {
            effects[static_cast<std::size_t>(moved)].push_back(effect);
        }
    }
    Measures measures;
    for (const std::vector<double>& of_parameter : effects) {
        const int count = static_cast<int>(of_parameter.size());
        measures.mu_star.push_back(
            bootstrap(count, seed_, [&](std::span<const int> drawn) { return mean_size(drawn, of_parameter); }));
        measures.sigma.push_back(
            bootstrap(count, seed_, [&](std::span<const int> drawn) { return standard_deviation(drawn, of_parameter); }));
    }
    return measures;
}

}  // namespace crampfit
