#include "imaging/strain.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

namespace crampfit {
namespace {

constexpr int reach = 3;             // points to either side
constexpr int edge = 2 * reach + 1;  // of the window
constexpr int least_points = 12;     // twice the polynomial's coefficients

/// The window about a point along one direction, moved so that it does not stick out of the lattice: its first place.
int window_begin(int at, int count) { return std::clamp(at - reach, 0, std::max(0, count - edge)); }

/// Places in the window about a point that are joined to it through followed points, as offsets.
std::vector<std::array<int, 2>> joined(const PointLattice& lattice, const DisplacementField& field, int point) {
    const int column = point % lattice.columns, row = point / lattice.columns;
    const int left = window_begin(column, lattice.columns) - column, top = window_begin(row, lattice.rows) - row;
    const int right = std::min(left + edge, lattice.columns - column), bottom = std::min(top + edge, lattice.rows - row);
    std::array<bool, edge * edge> seen{};
    std::vector<std::array<int, 2>> places;
    const auto visit = [&](int dx, int dy) {
        if (dx < left || dx >= right || dy < top || dy >= bottom) return;
        bool& here = seen[static_cast<std::size_t>((dy - top) * edge + dx - left)];
        const int neighbour = point + dx + dy * lattice.columns;
        if (!here && field.status[static_cast<std::size_t>(neighbour)] == PointStatus::ok) places.push_back({dx, dy});
        here = true;
    };
    visit(0, 0);
    for (std::size_t i = 0; i < places.size(); ++i) {
        const auto [dx, dy] = places[i];  // a copy: visiting makes `places` grow
        visit(dx + 1, dy);
        visit(dx - 1, dy);
        visit(dx, dy + 1);
        visit(dx, dy - 1);
    }
    return places;
}

using Slopes = Eigen::Matrix2d;  // of u and v, a column each, along x and y, a row each [px a point]

/// Least squares over the places given; nothing where they do not determine a polynomial.
std::optional<Slopes> fit(const PointLattice& lattice, const DisplacementField& field, int point,
                          const std::vector<std::array<int, 2>>& places) {
    if (places.size() < least_points) return std::nullopt;
    Eigen::Matrix<double, 6, 6> normal = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, 2> right = Eigen::Matrix<double, 6, 2>::Zero();
    for (const auto& [dx, dy] : places) {
        const auto at = static_cast<std::size_t>(point + dx + dy * lattice.columns);
        const Eigen::Vector<double, 6> terms{1.0 * dx, 1.0 * dy, 1.0, 1.0 * dx * dx, 1.0 * dx * dy, 1.0 * dy * dy};
        normal += terms * terms.transpose();
        right += terms * Eigen::RowVector2d(field.u[at], field.v[at]);
    }
    // Places are whole numbers, so that a matrix that is singular is so up to rounding.
    const Eigen::LDLT<Eigen::Matrix<double, 6, 6>> factor(normal);
    if (!(factor.rcond() > 1e-8)) return std::nullopt;
    return factor.solve(right).topRows<2>();
}

/// The same for a window without gaps: symmetric, so that the other terms do not take part.
Slopes fit_whole_window(const PointLattice& lattice, const DisplacementField& field, int point) {
    constexpr int squares = edge * reach * (reach + 1) * edge / 3;  // sum of dx^2 over the window
    Slopes slopes = Slopes::Zero();
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx) {
            const auto at = static_cast<std::size_t>(point + dx + dy * lattice.columns);
            slopes += Eigen::Vector2d(dx, dy) * Eigen::RowVector2d(field.u[at], field.v[at]);
        }
    return slopes / squares;
}

bool window_is_whole(const PointLattice& lattice, const DisplacementField& field, int point) {
    const int column = point % lattice.columns, row = point / lattice.columns;
    if (column < reach || column + reach >= lattice.columns || row < reach || row + reach >= lattice.rows) return false;
    for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx)
            if (field.status[static_cast<std::size_t>(point + dx + dy * lattice.columns)] != PointStatus::ok) return false;
    return true;
}

}  // namespace

void add_strain(const PointLattice& lattice, DisplacementField& field) {
    const auto count = static_cast<std::size_t>(lattice.count());
    for (std::vector<double>* strain : {&field.exx, &field.eyy, &field.exy})
        strain->assign(count, std::numeric_limits<double>::quiet_NaN());
    for (int point = 0; point < lattice.count(); ++point) {
        const auto at = static_cast<std::size_t>(point);
        if (field.status[at] != PointStatus::ok) continue;
        const std::optional<Slopes> slopes = window_is_whole(lattice, field, point)
                                                 ? fit_whole_window(lattice, field, point)
                                                 : fit(lattice, field, point, joined(lattice, field, point));
        if (slopes) {
            field.exx[at] = (*slopes)(0, 0) / lattice.step;
            field.eyy[at] = (*slopes)(1, 1) / lattice.step;
            field.exy[at] = ((*slopes)(1, 0) + (*slopes)(0, 1)) / 2 / lattice.step;
        }
    }
}

}  // namespace crampfit
