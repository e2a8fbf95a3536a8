#include "forward/thin_voids.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

namespace crampfit {

namespace {

// Whether a void goes through the point's domain: of the wood there is less than on both sides of it.
bool is_slotted(const Discretisation& body, int p) {
    constexpr double less = 0.1;  // of a whole domain
    const double whole = body.layout.point_size().prod() * body.layout.thickness;
    const auto share = [&](int point) { return point < 0 ? 0.0 : body.points.volume[point] / whole; };
    const double here = share(p);
    const auto rises = [&](const Eigen::Vector2i& step) {
        const int beside = body.neighbour(p, step.x(), step.y());
        const int beyond = body.neighbour(p, 2 * step.x(), 2 * step.y());
        return share(beside) > here + less || (beside >= 0 && share(beside) > here - less && share(beyond) > here + less);
    };
    return here < 1.0 - less && ((rises({1, 0}) && rises({-1, 0})) || (rises({0, 1}) && rises({0, -1})));
}

// The points of the four cells around a corner, by their pieces: those that no wood joins within these cells. None where the
// cells are full.
std::vector<std::vector<int>> pieces_around(const Discretisation& body, int i, int j, const std::vector<bool>& is_slotted) {
    const Layout& layout = body.layout;
    const std::array<int, 4> cells{layout.cell_index(i - 1, j - 1), layout.cell_index(i, j - 1), layout.cell_index(i - 1, j),
                                   layout.cell_index(i, j)};
    std::vector<std::vector<int>> pieces;
    if (std::ranges::all_of(cells, [&](int c) { return body.cell_is_full(c); })) return pieces;
    std::vector<int> rest;
    for (const int c : cells)
        for (int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1]; ++p)
            if (!is_slotted[p]) rest.push_back(p);
    while (!rest.empty()) {
        std::vector<int> piece{rest.back()};
        rest.pop_back();
        for (std::size_t k = 0; k < piece.size(); ++k)
            for (const Eigen::Vector2i& step :
                 {Eigen::Vector2i(1, 0), Eigen::Vector2i(-1, 0), Eigen::Vector2i(0, 1), Eigen::Vector2i(0, -1)}) {
                const auto found = std::ranges::find(rest, body.neighbour(piece[k], step.x(), step.y()));
                if (found == rest.end()) continue;
                piece.push_back(*found);
                rest.erase(found);
            }
        pieces.push_back(piece);
    }
    return pieces;
}

}  // namespace

std::optional<Plan::Choice> thin_voids(const Scene& scene, const Discretisation& body) {
    if (scene.specimen.parts.size() > 1) return std::nullopt;  // they have fields of their own
    const Layout& layout = body.layout;
    std::vector<bool> slotted(body.points.position.size());
    for (int p = 0; p < body.points.count(); ++p) slotted[p] = is_slotted(body, p);
    int bridged = 0;
    Vec2 last = Vec2::Zero();
    for (int j = 1; j < layout.cells_y; ++j)
        for (int i = 1; i < layout.cells_x; ++i) {
            const auto pieces = pieces_around(body, i, j, slotted);
            const auto counts = [](const std::vector<int>& piece) { return piece.size() > 1; };  // one may be a rough side's
            if (std::ranges::count_if(pieces, counts) < 2) continue;
            ++bridged;
            last = Vec2(i, j).cwiseProduct(layout.cell);
        }
    constexpr int most_at_a_root = 3;  // of a notch
    if (bridged <= most_at_a_root) return std::nullopt;
    return Plan::Choice{
        "thin voids", fmt::format("bridged at {} nodes, as at ({:.4g}, {:.4g}) mm", bridged, 1e3 * last.x(), 1e3 * last.y()),
        "less than two cells wide: wood on both sides moves together there, unless a crack is drawn along the void or cells are "
        "finer",
        true};
}

}  // namespace crampfit
