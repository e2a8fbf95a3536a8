#include "forward/loose_pieces.hpp"

#include <Eigen/Eigenvalues>

#include <algorithm>
#include <map>
#include <numeric>
#include <set>

namespace crampfit {

namespace {

// Which piece each field belongs to: the fields that points join, or what holds a pair, by the first of them.
std::vector<int> pieces_of(const Discretisation& body, const CrackFields& cracks,
                           const std::function<bool(std::size_t)>& joined) {
    std::vector<int> piece(cracks.fields());
    std::iota(piece.begin(), piece.end(), 0);
    const auto first = [&](int field) {
        while (piece[field] != field) field = piece[field] = piece[piece[field]];
        return field;
    };
    const auto join = [&](int a, int b) {
        a = first(a);
        b = first(b);
        piece[std::max(a, b)] = std::min(a, b);
    };
    for (int p = 0; p < body.points.count(); ++p)
        for (int k = 1; k < body.layout.nodes_per_cell(); ++k) join(body.points.node[p][0], body.points.node[p][k]);
    for (const Sliver& sliver : body.slivers)
        for (int k = 1; k < 4; ++k) join(sliver.node[0], sliver.node[k]);
    for (std::size_t k = 0; k < cracks.pairs.size(); ++k)
        if (joined(k)) join(cracks.pairs[k].left, cracks.pairs[k].right);
    for (std::size_t f = 0; f < piece.size(); ++f) piece[f] = first(static_cast<int>(f));
    return piece;
}

}  // namespace

LoosePieces find_loose_pieces(const Discretisation& body, const CrackFields& cracks, const Boundary& boundary,
                              const std::vector<double>& mass, double heaviest) {
    const std::vector<int> piece =
        pieces_of(body, cracks, [&](std::size_t k) { return shared_tie(cracks.pairs[k], mass) > 0.0; });
    if (std::ranges::none_of(cracks.pairs, [&](const FieldPair& pair) {
            return mass[pair.left] > 0.0 && mass[pair.right] > 0.0 && piece[pair.left] != piece[pair.right];
        }))
        return {};
    // How a component of displacement goes with a piece's ways to move as a whole: along x, along y, and turning.
    const double size = body.layout.size().maxCoeff();
    const auto motion = [&](int field, int axis) {
        const Vec2 x = body.layout.node_position(cracks.node_of_field[field]) / size - Vec2(0.5, 0.5);
        return axis == 0 ? Eigen::Vector3d(1.0, 0.0, -x.y()) : Eigen::Vector3d(0.0, 1.0, x.x());
    };
    std::vector<bool> held(2 * piece.size(), false), left_alone(piece.size(), false);
    std::map<int, Eigen::Matrix3d> holds;  // by piece
    std::vector<double> weight(piece.size(), 0.0);
    for (std::size_t f = 0; f < piece.size(); ++f) {
        weight[piece[f]] += mass[f];
        if (mass[f] > 0.0) holds.emplace(piece[f], Eigen::Matrix3d::Zero());
    }
    const auto take_in = [&](const auto& h) {
        if (mass[h.field] == 0.0) return;
        held[2 * h.field + h.axis] = true;
        const Eigen::Vector3d row = motion(h.field, h.axis);
        holds.at(piece[h.field]) += row * row.transpose();
    };
    std::ranges::for_each(boundary.held, take_in);
    std::ranges::for_each(boundary.tied, take_in);
    for (std::size_t f = 0; f < piece.size(); ++f) left_alone[f] = weight[f] > heaviest;
    for (const Boundary::Traction& t : boundary.tractions) left_alone[piece[t.field[0]]] = true;

    LoosePieces found;
    found.loose.assign(piece.size(), false);
    for (std::size_t f = 0; f < piece.size(); ++f)
        found.loose[f] = mass[f] > 0.0 && holds.at(piece[f]).isZero(0.0) && !left_alone[piece[f]];
    for (auto& [own, sum] : holds) {
        while (!left_alone[own]) {
            constexpr double nothing = 1e-6;  // squared distance of neighbouring nodes over the specimen's size, and less
            const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> ways(sum);
            if (ways.eigenvalues()[0] > nothing) break;
            const Eigen::Vector3d free = ways.eigenvectors().col(0);
            int best = -1;
            double most = 0.0;
            for (std::size_t dof = 0; dof < held.size(); ++dof) {
                const int field = static_cast<int>(dof / 2);
                if (piece[field] != own || mass[field] == 0.0 || held[dof]) continue;
                const double moves = std::abs(free.dot(motion(field, static_cast<int>(dof % 2))));
                if (moves <= most * (1.0 + 1e-9)) continue;
                most = moves;
                best = static_cast<int>(dof);
            }
            if (best < 0) break;
            held[best] = true;
            found.holds.push_back(best);
            const Eigen::Vector3d row = motion(best / 2, best % 2);
            sum += row * row.transpose();
        }
    }
    return found;
}

bool carries_load(const Discretisation& body, const CrackFields& cracks, const Boundary& boundary,
                  const std::vector<double>& mass, const std::vector<Vec2>& displacement, const std::vector<Box>& pushes,
                  const std::function<bool(std::size_t pair)>& joined) {
    const std::vector<int> piece = pieces_of(body, cracks, joined);
    std::map<int, std::set<int>> holders;  // drivers by piece
    const auto take_in = [&](const auto& h) {
        if (mass[h.field] > 0.0) holders[piece[h.field]].insert(h.driver);
    };
    std::ranges::for_each(boundary.held, take_in);
    std::ranges::for_each(boundary.tied, take_in);
    if (std::ranges::any_of(holders, [](const auto& of_piece) { return of_piece.second.size() > 1; })) return true;
    const auto is_held = [&](int field) { return holders.count(piece[field]) > 0; };
    if (std::ranges::any_of(boundary.tractions, [&](const Boundary::Traction& t) { return is_held(t.field[0]); })) return true;
    for (std::size_t f = 0; f < piece.size() && !pushes.empty(); ++f) {
        if (mass[f] == 0.0 || !is_held(static_cast<int>(f))) continue;
        const Vec2 x = body.layout.node_position(cracks.node_of_field[f]) + displacement[f];
        if (std::ranges::any_of(pushes, [&](const Box& box) { return box.contains(x); })) return true;
    }
    return false;
}

}  // namespace crampfit
