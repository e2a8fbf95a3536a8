#include "forward/bridging.hpp"

#include "forward/tip_ties.hpp"

#include <algorithm>
#include <cmath>
#include <map>

namespace crampfit {

namespace {

constexpr double places_in_cell = 16.0;  // at which faces of the start are shared out

double opening_of(const FieldPair& pair, const std::vector<Vec2>& displacement) {
    return (displacement[pair.left] - displacement[pair.right]).dot(pair.normal);
}

// How much of the crack a pair stands for. Of a hat on a node as far from the crack as leaves it the value N there, the part N^2 / 2
// lies beyond.
double weight_of(double left, double right) { return std::sqrt(2.0 * std::min(left, right) / (left + right)); }

} // namespace

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

BridgedFaces::BridgedFaces(const Scene& scene, const Discretisation& body, const CrackFields& cracks, const std::vector<double>& mass,
                           double most_frequency_squared)
    : scene_(scene), body_(body), most_frequency_squared_(most_frequency_squared), still_to_share_(scene.cracks.size(), 0.0) {
    for (const CrackLine& line : cracks.lines) length_.push_back(line.length);
    bridges_.resize(cracks.pairs.size());
    for (std::size_t k = 0; k < bridges_.size(); ++k) bridges_[k].freed = std::clamp(cracks.pairs[k].freed, 0.0, 1.0);
    take_in(cracks, mass, {});
    for (int k = 0; k < static_cast<int>(scene.cracks.size()); ++k)
        if (scene.cracks[k].faces.bridging && scene.cracks[k].faces.bridging->on_all_faces) lay_on_faces(k, cracks);
}

bool BridgedFaces::are_in(const Scene& scene) {
    return std::any_of(scene.cracks.begin(), scene.cracks.end(), [](const Crack& crack) { return crack.faces.bridging.has_value(); });
}

// Each place on the crack goes to the pairs of its cell by their shape functions.
void BridgedFaces::lay_on_faces(int crack, const CrackFields& cracks) {
    const Layout& layout = body_.layout;
    const auto& points = cracks.lines[crack].points;
    std::multimap<int, std::size_t> at_node;
    for (std::size_t k = 0; k < bridges_.size(); ++k)
        if (cracks.pairs[k].crack == crack && bridges_[k].share > 0.0) at_node.emplace(cracks.pairs[k].node, k);
    for (std::size_t i = 0; i + 1 < points.size(); ++i) {
        const Vec2 along = points[i + 1] - points[i];
        const int places = static_cast<int>(std::ceil(places_in_cell * along.norm() / layout.cell.minCoeff()));
        for (int j = 0; j < places; ++j) {
            const Vec2 x = points[i] + (j + 0.5) / places * along;
            if (body_.point_at(x) < 0) continue;
            const int c = layout.cell_at(x);
            const auto nodes = layout.cell_nodes(c);
            const auto values = body_.values_at(c, x);
            std::vector<std::pair<std::size_t, double>> here;  // pairs and their shares
            double sum = 0.0;
            for (int n = 0; n < layout.nodes_per_cell(); ++n) {
                const auto [first, last] = at_node.equal_range(nodes[n]);
                for (auto pair = first; pair != last; ++pair) {
                    here.emplace_back(pair->second, values[n]);
                    sum += values[n];
                }
            }
            for (const auto& [k, value] : here)
                if (sum > 0.0) bridges_[k].area += value / sum * along.norm() / places * layout.thickness;
        }
    }
    for (std::size_t k = 0; k < bridges_.size(); ++k)
        if (bridges_[k].area > 0.0 && cracks.pairs[k].crack == crack) live_.push_back(k);
}

double BridgedFaces::take_in(const CrackFields& cracks, const std::vector<double>& mass, const std::vector<Vec2>& displacement) {
    std::vector<double> passing(cracks.lines.size(), 0.0);  // pairs by their weight
    std::vector<double> gone(cracks.pairs.size(), 0.0);
    bridges_.resize(cracks.pairs.size());
    for (std::size_t k = 0; k < bridges_.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        const double left = mass[pair.left], right = mass[pair.right];
        Bridge& bridge = bridges_[k];
        const double freed = std::clamp(pair.freed, bridge.freed, 1.0);
        gone[k] = freed - bridge.freed;
        bridge.freed = freed;
        const bool is_bridged = scene_.cracks[pair.crack].faces.bridging && left > 0.0 && right > 0.0;
        bridge.share = is_bridged ? weight_of(left, right) : 0.0;
        bridge.stiffest = is_bridged ? freed * most_frequency_squared_ * left * right / (left + right) : 0.0;  // the rest is the tie's
        passing[pair.crack] += bridge.share * gone[k];
    }
    double taken = 0.0;
    for (std::size_t c = 0; c < cracks.lines.size(); ++c) {
        if (!scene_.cracks[c].faces.bridging) continue;
        still_to_share_[c] += (cracks.lines[c].length - length_[c]) * body_.layout.thickness;
        length_[c] = cracks.lines[c].length;
    }
    for (std::size_t k = 0; k < bridges_.size(); ++k) {
        const int c = cracks.pairs[k].crack;
        const double added = gone[k] * bridges_[k].share > 0.0 ? still_to_share_[c] * gone[k] * bridges_[k].share / passing[c] : 0.0;
        if (added == 0.0) continue;
        if (bridges_[k].area == 0.0) live_.push_back(k);
        bridges_[k].area += added;
        const BridgeState now = state(cracks, k, displacement);
        taken += added * (now.stored + now.dissipated);
    }
    for (std::size_t c = 0; c < passing.size(); ++c)
        if (passing[c] > 0.0) still_to_share_[c] = 0.0;
    return taken;
}

BridgeState BridgedFaces::state(const CrackFields& cracks, std::size_t k, const std::vector<Vec2>& displacement) const {
    const FieldPair& pair = cracks.pairs[k];
    const Bridge& bridge = bridges_[k];
    const double opening = opening_of(pair, displacement);
    return bridge_state(*scene_.cracks[pair.crack].faces.bridging, bridge.stiffest / bridge.area, std::max(bridge.largest, opening), opening);
}

void BridgedFaces::pull(const CrackFields& cracks, const std::vector<Vec2>& displacement, std::vector<Vec2>& force) {
    for (const std::size_t k : live_) {
        const FieldPair& pair = cracks.pairs[k];
        Bridge& bridge = bridges_[k];
        bridge.largest = std::max(bridge.largest, opening_of(pair, displacement));
        bridge.force = bridge.area * state(cracks, k, displacement).traction;
        force[pair.left] -= bridge.force * pair.normal;
        force[pair.right] += bridge.force * pair.normal;
    }
}

void BridgedFaces::add_to(std::vector<Vec2>& faces, const CrackFields& cracks) const {
    faces.resize(cracks.pairs.size(), Vec2::Zero());
    for (const std::size_t k : live_) faces[k] -= bridges_[k].force * cracks.pairs[k].normal;
}

double BridgedFaces::price_of_new_faces(const CrackFields& cracks, int crack, bool at_end, const std::vector<Vec2>& displacement) const {
    double sum = 0.0, weights = 0.0;
    for (std::size_t k = 0; k < bridges_.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        const double share = bridges_[k].share;
        if (bridges_[k].area == 0.0 || bridges_[k].freed >= 1.0 || !TipTies::is_of(cracks, pair, crack, at_end)) continue;
        const BridgeState now = state(cracks, k, displacement);
        sum += share * (now.stored + now.dissipated);
        weights += share;
    }
    return weights > 0.0 ? sum / weights : 0.0;
}

BridgedFaces::Energies BridgedFaces::energies(const CrackFields& cracks, const std::vector<Vec2>& displacement) const {
    Energies sum;
    for (const std::size_t k : live_) {
        const BridgeState now = state(cracks, k, displacement);
        sum.stored += bridges_[k].area * now.stored;
        sum.dissipated += bridges_[k].area * now.dissipated;
    }
    return sum;
}

} // namespace crampfit
