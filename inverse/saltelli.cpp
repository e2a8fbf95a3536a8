#include "inverse/saltelli.hpp"

#include "inverse/sobol_points.hpp"

#include <cassert>
#include <cmath>

namespace crampfit {
namespace {

constexpr double least_spread = 1e-12;  // of the mean: below it, a standard deviation is none

// Values at A, B and A with a column of B, row by row, about their common mean: products lose fewer digits, and the
// estimate of a first index scatters less (Sobol 2001).
struct Rows {
    std::vector<double> a, b, ab;
    double centre = 0;

    void add(double in_a, double in_b, double in_ab) {
        a.push_back(in_a);
        b.push_back(in_b);
        ab.push_back(in_ab);
    }
    int size() const { return static_cast<int>(a.size()); }

    void take_off_mean() {
        for (std::size_t i = 0; i < a.size(); ++i) {
            centre += 0.5 * (a[i] + b[i]) / static_cast<double>(a.size());
        }
        for (auto* column : {&a, &b, &ab}) {
            for (double& value : *column) {
                value -= centre;
            }
        }
    }
};

// Sum over rows of a product, over the variance of all that A and B hold. Table 2 of Saltelli et al. (2010).
template <class Term>
double part_of_variance(const Rows& rows, std::span<const int> drawn, const Term& term) {
    double sum = 0, sum_of_squares = 0, sum_of_terms = 0;
    for (const int row : drawn) {
        const auto i = static_cast<std::size_t>(row);
        sum += rows.a[i] + rows.b[i];
        sum_of_squares += rows.a[i] * rows.a[i] + rows.b[i] * rows.b[i];
        sum_of_terms += term(rows.a[i], rows.b[i], rows.ab[i]);
    }
    const auto count = static_cast<double>(drawn.size());
    const double mean = sum / (2 * count);
    const double variance = sum_of_squares / (2 * count) - mean * mean;
    const double least = least_spread * (std::abs(rows.centre) + std::abs(mean));
    return variance > least * least ? sum_of_terms / count / variance : 0.0;
}

}  // namespace

SaltelliDesign::SaltelliDesign(Eigen::Index parameters, int rows, unsigned seed)
    : parameters_(parameters), rows_(rows), seed_(seed) {
    for (const Eigen::VectorXd& both : sobol_points(rows, 2 * parameters, seed)) {
        const Eigen::VectorXd a = both.head(parameters);
        const Eigen::VectorXd b = both.tail(parameters);
        points_.push_back(a);
        points_.push_back(b);
        for (Eigen::Index j = 0; j < parameters; ++j) {
            points_.push_back(a);
            points_.back()[j] = b[j];
        }
    }
}

SaltelliDesign::Indices SaltelliDesign::indices(std::span<const double> values) const {
    assert(values.size() == points_.size());
    Indices indices;
    for (Eigen::Index j = 0; j < parameters_; ++j) {
        Rows rows;
        for (int i = 0; i < rows_; ++i) {
            const auto row = values.subspan(static_cast<std::size_t>(i * (parameters_ + 2)));
            const double mixed = row[static_cast<std::size_t>(2 + j)];
            if (std::isfinite(row[0]) && std::isfinite(row[1]) && std::isfinite(mixed)) {
                rows.add(row[0], row[1], mixed);
            }
        }
        rows.take_off_mean();
        const auto first = [](double a, double b, double ab) { return b * (ab - a); };             // (b)
        const auto total = [](double a, double, double ab) { return 0.5 * (a - ab) * (a - ab); };  // (f), Jansen (1999)
        indices.first.push_back(
            bootstrap(rows.size(), seed_, [&](std::span<const int> drawn) { return part_of_variance(rows, drawn, first); }));
        indices.total.push_back(
            bootstrap(rows.size(), seed_, [&](std::span<const int> drawn) { return part_of_variance(rows, drawn, total); }));
    }
    return indices;
}

}  // namespace crampfit
