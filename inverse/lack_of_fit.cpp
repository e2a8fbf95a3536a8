#include "inverse/lack_of_fit.hpp"

#include <boost/math/distributions/chi_squared.hpp>
#include <boost/math/distributions/normal.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace crampfit {
namespace {

FitCheck check_curve(const FitResidual* begin, const FitResidual* end, double parameters) {
    const auto n = static_cast<double>(end - begin);
    FitCheck check{begin->experiment, begin->kind, static_cast<int>(end - begin)};
    double neighbours = 0;
    for (const FitResidual* row = begin; row != end; ++row) {
        check.chi_square += row->residual * row->residual;
        neighbours += row + 1 != end ? row->residual * (row + 1)->residual : 0.0;
    }
    const double freedom = std::max(1.0, n - parameters);
    check.p_chi_square = std::isfinite(check.chi_square)
                             ? boost::math::cdf(boost::math::complement(boost::math::chi_squared(freedom), check.chi_square))
                             : 0.0;
    check.autocorrelation = check.chi_square > 0 && std::isfinite(check.chi_square) ? neighbours / check.chi_square : 0.0;
    const double z = (check.autocorrelation + 1 / n) * std::sqrt(n);
    check.p_autocorrelation = boost::math::cdf(boost::math::complement(boost::math::normal(), z));
    return check;
}

}  // namespace

std::vector<FitCheck> check_fit(const std::vector<FitResidual>& residuals, int parameters) {
    std::vector<FitCheck> checks;
    for (std::size_t begin = 0, end = 0; begin < residuals.size(); begin = end) {
        while (end < residuals.size() && residuals[end].experiment == residuals[begin].experiment &&
               residuals[end].kind == residuals[begin].kind) {
            ++end;
        }
        const double share = static_cast<double>(end - begin) / static_cast<double>(residuals.size());
        checks.push_back(check_curve(residuals.data() + begin, residuals.data() + end, parameters * share));
    }
    return checks;
}

std::string lack_of_fit(const std::vector<FitCheck>& checks) {
    const double rare = 0.01 / (2 * static_cast<double>(std::max<std::size_t>(1, checks.size())));  // Bonferroni
    std::string text;
    for (const FitCheck& check : checks) {
        const std::string curve = fmt::format("{} of '{}'", check.kind, check.experiment);
        if (check.p_chi_square < rare) {
            text += fmt::format(
                "Lack of fit: the residuals of {} are {:.2g} times what the noise explains (chi-square test, p = {:.1g}). ",
                curve, std::sqrt(check.chi_square / check.points), check.p_chi_square);
        }
        // Far below the errors that were allowed for, residuals are the rounding of data or model.
        const bool is_small = check.chi_square < 0.01 * check.points;
        if (check.p_autocorrelation < rare && !is_small) {
            text +=
                fmt::format("Lack of fit: the residuals of {} go together (autocorrelation {:.2f}, p = {:.1g}): the model, or "
                            "its grid, misses something there. ",
                            curve, check.autocorrelation, check.p_autocorrelation);
        }
    }
    return text;
}

std::string opposite_forces(const std::vector<FitResidual>& residuals) {
    constexpr double clearly = -0.5;  // cosine between both curves
    struct Sums {
        double product = 0, measured = 0, modelled = 0;
    };
    std::map<std::string, Sums> experiments;
    for (const FitResidual& row : residuals) {
        if (row.kind != "force") continue;
        Sums& sums = experiments[row.experiment];
        sums.product += row.measured * row.modelled;
        sums.measured += row.measured * row.measured;
        sums.modelled += row.modelled * row.modelled;
    }
    std::string text;
    for (const auto& [name, sums] : experiments) {
        if (sums.product < clearly * std::sqrt(sums.measured * sums.modelled)) {
            text += fmt::format("The forces of '{}' have the other sign than the modelled ones, which are positive along the "
                                "motion that they drive: turn the sign of the data. ",
                                name);
        }
    }
    return text;
}

}  // namespace crampfit
