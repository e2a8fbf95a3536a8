#include "inverse/sobol_points.hpp"

#include <boost/random/sobol.hpp>

#include <cstdint>
#include <random>

namespace crampfit {

std::vector<Eigen::VectorXd> sobol_points(int count, Eigen::Index dimensions, unsigned seed) {
    constexpr unsigned digits = 32;
    constexpr double one = 4294967296.0;  // 2^32
    std::mt19937 generator(seed);
    std::vector<std::uint32_t> shift(static_cast<std::size_t>(dimensions));
    for (std::uint32_t& digits_of_one : shift) {
        digits_of_one = static_cast<std::uint32_t>(generator());
    }
    boost::random::sobol_engine<std::uint64_t, digits> sequence(static_cast<std::size_t>(dimensions));
    std::vector<Eigen::VectorXd> points;
    for (int i = 0; i < count; ++i) {
        Eigen::VectorXd point(dimensions);
        for (Eigen::Index j = 0; j < dimensions; ++j) {
            // Boost leaves out the sequence's first point, the origin.
            const std::uint64_t coordinate = i == 0 ? 0 : sequence();
            const auto shifted = static_cast<double>(coordinate ^ shift[static_cast<std::size_t>(j)]);
            point[j] = (shifted + 0.5) / one;
        }
        points.push_back(point);
    }
    return points;
}

Eigen::VectorXd sobol_point(int number, Eigen::Index dimensions, unsigned seed) {
    return sobol_points(number + 1, dimensions, seed).back();
}

}  // namespace crampfit
