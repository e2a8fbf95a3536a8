#include "inverse/unit_box.hpp"

#include <algorithm>
#include <cmath>

namespace crampfit {

double UnitBox::value(Eigen::Index j, double x) const {
    const Parameter& p = parameter(j);
    const double value =
        p.scale == Scale::logarithmic ? p.lower * std::pow(p.upper / p.lower, x) : p.lower + x * (p.upper - p.lower);
    return std::clamp(value, p.lower, p.upper);
}

double UnitBox::share(Eigen::Index j, double value) const {
    const Parameter& p = parameter(j);
    return p.scale == Scale::logarithmic ? std::log(value / p.lower) / std::log(p.upper / p.lower)
                                         : (value - p.lower) / (p.upper - p.lower);
}

double UnitBox::slope(Eigen::Index j, double x) const {
    const Parameter& p = parameter(j);
    return p.scale == Scale::logarithmic ? value(j, x) * std::log(p.upper / p.lower) : p.upper - p.lower;
}

Eigen::VectorXd UnitBox::values(const Eigen::VectorXd& x) const {
    Eigen::VectorXd result(size());
    for (Eigen::Index j = 0; j < size(); ++j) {
        result[j] = value(j, x[j]);
    }
    return result;
}

Eigen::VectorXd UnitBox::initial() const {
    Eigen::VectorXd x(size());
    for (Eigen::Index j = 0; j < size(); ++j) {
        x[j] = share(j, parameter(j).initial);
    }
    return x;
}

std::vector<double> in_units(const UnitBox& box, const Eigen::VectorXd& x) {
    std::vector<double> values;
    for (Eigen::Index j = 0; j < box.size(); ++j) {
        values.push_back(box.value(j, x[j]) / box.parameters()[static_cast<std::size_t>(j)].unit_factor);
    }
    return values;
}

}  // namespace crampfit
