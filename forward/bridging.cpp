#include "forward/bridging.hpp"

#include "forward/tip_ties.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace crampfit {

namespace {

constexpr double places_in_cell = 16.0;  // along a crack, at which its faces are shared out

// Ties are made softer for bridges that soften as fast as the wood yields to no more than this part of the wood's stiffness.
constexpr double least_stiffness_left = 0.1;

double opening_of(const FieldPair& pair, const Vec2& normal, const std::vector<Vec2>& displacement) {
    return (displacement[pair.left] - displacement[pair.right]).dot(normal);
}

}  // namespace

BridgeState bridge_state(const Bridging& law, double steepest, double largest, double opening) {
    const double now = std::clamp(opening, 0.0, largest);
    const double most = law.stress * std::max(0.0, 1.0 - largest / law.opening);
    const double slope = most > steepest * largest ? steepest : largest > 0.0 ? most / largest : 0.0;
    const double held = most - slope * largest;  // with the faces closed
    const double reached = std::min(largest, law.opening);
    const double taken = law.stress * reached * (1.0 - 0.5 * reached / law.opening);
    BridgeState state;
    state.traction = held + slope * now;
    state.stored = 0.5 * (held + state.traction) * now;
    state.dissipated = taken - 0.5 * (held + most) * largest;
    return state;
}

BridgedFaces::BridgedFaces(const Scene& scene, const Discretisation& body, const CrackFields& cracks,
                           const std::vector<double>& mass, double most_frequency_squared)
    : scene_(scene), body_(body), most_frequency_squared_(most_frequency_squared), bridges_(cracks.pairs.size()) {
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k)
        if (scene.cracks[k].faces.bridging && scene.cracks[k].faces.bridging->on_all_faces) bridge_notch(k, cracks, mass);
    take_in(cracks, mass);
}

bool BridgedFaces::are_in(const Scene& scene) {
    return std::any_of(scene.cracks.begin(), scene.cracks.end(),
                       [](const Crack& crack) { return crack.faces.bridging.has_value(); });
}

// Each place on the crack goes to the pairs of its cell by their shape functions; a pair that the tip has begun to free is
// bridged as a whole, as those are that it comes to later.
void BridgedFaces::bridge_notch(int crack, const CrackFields& cracks, const std::vector<double>& mass) {
    const Layout& layout = body_.layout;
    const auto& points = cracks.lines[crack].points;
    std::multimap<int, std::size_t> at_node;
    for (std::size_t k = 0; k < cracks.pairs.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        if (pair.crack == crack && mass[pair.left] > 0.0 && mass[pair.right] > 0.0) at_node.emplace(pair.node, k);
    }
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const Vec2 along = points[i + 1] - points[i];
        const int places = static_cast<int>(std::ceil(places_in_cell * along.norm() / layout.cell.minCoeff()));
        for (int j = 0; j < places; ++j) {
            const Vec2 x = points[i] + (j + 0.5) / places * along;
            if (body_.point_at(x) < 0) continue;
            const int c = layout.cell_at(x);
            const auto nodes = layout.cell_nodes(c);
            const auto values = body_.values_at(c, x);
            double sum = 0.0;
            for (int n = 0; n < layout.nodes_per_cell(); ++n) sum += values[n] * static_cast<double>(at_node.count(nodes[n]));
            for (int n = 0; n < layout.nodes_per_cell() && sum > 0.0; ++n) {
                const auto [first, last] = at_node.equal_range(nodes[n]);
                for (auto pair = first; pair != last; ++pair)
                    bridges_[pair->second].area += values[n] / sum * along.norm() / places * layout.thickness;
            }
        }
    }
    for (const auto& [node, k] : at_node) {
        if (cracks.pairs[k].freed < 1.0) bridges_[k].area = area_ahead(cracks, cracks.pairs[k]);
        if (bridges_[k].area > 0.0) live_.push_back(k);
    }
}

// Whether wood that moves with a node lies on either side of a straight crack.
bool BridgedFaces::is_cut(int node, const Vec2& on_crack, const Vec2& along) const {
    const Layout& layout = body_.layout;
    bool left = false, right = false;
    body_.for_cells_in(layout.support(node), [&](int c) {
        const auto nodes = layout.cell_nodes(c);
        if (std::find(nodes.begin(), nodes.begin() + layout.nodes_per_cell(), node) == nodes.begin() + layout.nodes_per_cell())
            return;
        for (int p = body_.points.first_of_cell[c]; p < body_.points.first_of_cell[c + 1]; ++p)
            (cross(along, body_.points.position[p] - on_crack) >= 0.0 ? left : right) = true;
    });
    return left && right;
}

// The faces of a pair that a tip is about to free, were the crack straight about it [m^2]. As above, but pairs farther ahead are
// not there yet.
double BridgedFaces::area_ahead(const CrackFields& cracks, const FieldPair& pair) const {
    const Layout& layout = body_.layout;
    const bool at_end = TipTies::is_of(cracks, pair, pair.crack, true);
    const Vec2& tip = cracks.lines[pair.crack].tip(at_end).position;
    const Vec2& along = pair.along;
    const double beside = (layout.node_position(pair.node) - tip).dot(along);
    const double step = layout.cell.minCoeff() / places_in_cell;
    const int reach = static_cast<int>(std::ceil((layout.degree + 1) * layout.cell.maxCoeff() / step));
    std::map<int, bool> cut;
    double length = 0.0;
    for (int j = -reach; j < reach; ++j) {
        const Vec2 x = tip + (beside + (j + 0.5) * step) * along;
        if (body_.point_at(x) < 0) continue;
        const int c = layout.cell_at(x);
        const auto nodes = layout.cell_nodes(c);
        const auto values = body_.values_at(c, x);
        double own = 0.0, sum = 0.0;
        for (int n = 0; n < layout.nodes_per_cell(); ++n) {
            const auto [found, is_new] = cut.try_emplace(nodes[n], false);
            if (is_new) found->second = is_cut(nodes[n], tip, along);
            if (!found->second) continue;
            sum += values[n];
            if (nodes[n] == pair.node) own = values[n];
        }
        if (own > 0.0) length += own / sum * step;
    }
    return length * layout.thickness;
}

double BridgedFaces::softer_ties(const CrackFields& cracks, double softness) const {
    double most = 1.0;
    for (std::size_t k = bridges_.size(); k < cracks.pairs.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        const auto& law = scene_.cracks[pair.crack].faces.bridging;
        if (!law || !std::isfinite(pair.compliance)) continue;
        const double faces = pair.along.cwiseProduct(body_.layout.cell).norm() * body_.layout.thickness;
        const double steepness = law->stress / law->opening * faces * softness * pair.compliance;
        most = std::max(most, 1.0 / std::max(least_stiffness_left, 1.0 - steepness));
    }
    return most;
}

void BridgedFaces::take_in(const CrackFields& cracks, const std::vector<double>& mass) {
    const std::size_t known = bridges_.size();
    bridges_.resize(cracks.pairs.size());
    for (std::size_t k = 0; k < bridges_.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        const double left = mass[pair.left], right = mass[pair.right];
        if (!scene_.cracks[pair.crack].faces.bridging || left == 0.0 || right == 0.0) continue;
        if (k >= known) {
            bridges_[k].area = area_ahead(cracks, pair);
            if (bridges_[k].area > 0.0) live_.push_back(k);
        }
        const double freed = std::clamp(pair.freed, 0.0, 1.0);  // the rest of the stiffness is the tie's
        bridges_[k].stiffest = freed * most_frequency_squared_ * left * right / (left + right);
    }
}

bool BridgedFaces::holds(const CrackFields& cracks, std::size_t pair) const {
    return bridges_[pair].area > 0.0 && bridges_[pair].largest < scene_.cracks[cracks.pairs[pair].crack].faces.bridging->opening;
}

BridgeState BridgedFaces::state(const FieldPair& pair, const Bridge& bridge, double opening) const {
    return bridge_state(*scene_.cracks[pair.crack].faces.bridging, bridge.stiffest / bridge.area,
                        std::max(bridge.largest, opening), opening);
}

void BridgedFaces::pull(const CrackFields& cracks, const FaceNormals& normals, const std::vector<Vec2>& displacement,
                        std::vector<Vec2>& force) {
    for (const std::size_t k : live_) {
        const FieldPair& pair = cracks.pairs[k];
        Bridge& bridge = bridges_[k];
        const double opening = opening_of(pair, normals[k], displacement);
        bridge.largest = std::max(bridge.largest, opening);
        bridge.force = bridge.area * state(pair, bridge, opening).traction;
        force[pair.left] -= bridge.force * normals[k];
        force[pair.right] += bridge.force * normals[k];
    }
}

void BridgedFaces::add_to(std::vector<Vec2>& faces, const FaceNormals& normals) const {
    faces.resize(bridges_.size(), Vec2::Zero());
    for (const std::size_t k : live_) faces[k] -= bridges_[k].force * normals[k];
}

BridgedFaces::Energies BridgedFaces::energies(const CrackFields& cracks, const FaceNormals& normals,
                                              const std::vector<Vec2>& displacement) const {
    Energies sum;
    for (const std::size_t k : live_) {
        const FieldPair& pair = cracks.pairs[k];
        const BridgeState now = state(pair, bridges_[k], opening_of(pair, normals[k], displacement));
        sum.stored += bridges_[k].area * now.stored;
        sum.dissipated += bridges_[k].area * now.dissipated;
    }
    return sum;
}

}  // namespace crampfit
