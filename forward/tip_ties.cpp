#include "forward/tip_ties.hpp"

#include <algorithm>
#include <cmath>
#include <optional>

namespace crampfit {

namespace {

Vec2 jump_of(const FieldPair& pair, const std::vector<Vec2>& displacement) {
    return displacement[pair.left] - displacement[pair.right];
}

}  // namespace

double TipTies::share(const Tie& tie, double freed) const {
    if (freed >= 1.0) return 1.0;
    return std::max(0.0, (freed - tie.from) / (1.0 - tie.from));
}

double TipTies::stiffness(const Tie& tie, double f) const { return (1.0 - f) / ((f + tie.slack) * tie.compliance); }

// The way on which a tip frees a pair [m], as `CrackFields` has it.
double TipTies::width(const CrackTip& tip) const { return way_past_a_node(tip.direction, cell_); }

void TipTies::take_in(const CrackFields& cracks, const std::vector<double>& mass, const std::vector<Vec2>& displacement,
                      bool at_rest, double softness) {
    const std::size_t known = ties_.size();
    ties_.resize(cracks.pairs.size());
    live_.clear();
    const auto goes_on_like = [&](std::size_t k) -> std::optional<std::size_t> {
        const int like = k >= known ? cracks.pairs[k].like : -1;
        if (like < 0 || like >= static_cast<int>(known) || ties_[like].compliance == 0.0 || ties_[like].waits) return {};
        return like;
    };
    std::vector<bool> is_split(ties_.size(), false);  // by another crack: what a tie holds is shared out
    for (std::size_t k = known; k < ties_.size(); ++k)
        if (const auto like = goes_on_like(k)) is_split[k] = is_split[*like] = true;
    for (std::size_t k = ties_.size(); k-- > 0;) {  // what is split off comes before what it was
        const FieldPair& pair = cracks.pairs[k];
        Tie& tie = ties_[k];
        const double left = mass[pair.left];
        const double right = mass[pair.right];
        const Vec2 jump = jump_of(pair, displacement);
        const auto like = goes_on_like(k);
        const bool is_new = !like && (k >= known || tie.compliance == 0.0);  // or there was no wood on one side
        if (like) {
            tie = ties_[*like];
            tie.stretch += jump_of(cracks.pairs[*like], displacement) - jump;
        } else if (is_new) {
            tie = {.waits = !at_rest,
                   .from = at_rest ? 0.0 : std::max(0.0, pair.freed),
                   .softness = k >= known ? softness : tie.softness,
                   .begun_at = jump,
                   .from_rest = at_rest};
            tie.pulled_at = share(tie, pair.freed);
        }
        if (pair.freed >= 1.0 || left == 0.0 || right == 0.0 || !std::isfinite(pair.compliance)) continue;
        live_.push_back(k);
        const double compliance = tie.softness * pair.compliance / tie_share(left, right);
        const double most = most_frequency_squared_ * left * right / (left + right);
        const double f = share(tie, pair.freed);
        const double slack = std::max(tie.slack, (1.0 - f) / (most * compliance) - f);
        if (slack == tie.slack && compliance == tie.compliance) continue;
        const Tie before = tie;
        tie.compliance = compliance;
        tie.slack = slack;
        if (is_new || tie.waits) continue;
        if (is_split[k]) {
            tie.held *= before.compliance / compliance;
            continue;
        }
        tie.from_rest = false;
        // It goes on with the same force and energy; of a tip that has turned back, no harder than it did.
        const double at = std::max(f, tie.pulled_at);
        const Vec2 force = stiffness(before, at) * (jump + before.stretch);
        tie.stretch = force / stiffness(tie, f) - jump;
        tie.held = (0.5 * force.dot(tie.stretch - before.stretch) + (1.0 - at) * before.held) / (1.0 - f);
    }
    std::ranges::sort(live_);
}

void TipTies::settle(const CrackFields& cracks, const FaceNormals& normals, const std::vector<double>& mass,
                     const std::vector<Vec2>& force) {
    for (const std::size_t k : live_) {
        Tie& tie = ties_[k];
        if (!tie.waits) continue;
        const FieldPair& pair = cracks.pairs[k];
        const double left = mass[pair.left];
        const double right = mass[pair.right];
        Vec2 hold = (right * force[pair.left] - left * force[pair.right]) / (left + right);  // both sides go on alike
        hold -= std::min(0.0, hold.dot(normals[k])) * normals[k];                            // pressure is left to the faces
        tie.stretch = tie.slack * tie.compliance * hold - tie.begun_at;
        tie.held = 0.5 * tie.slack * tie.compliance * hold.squaredNorm();
        tie.waits = false;
    }
}

void TipTies::pull(const CrackFields& cracks, const std::vector<Vec2>& displacement, std::vector<Vec2>& force) {
    for (const std::size_t k : live_) {
        const FieldPair& pair = cracks.pairs[k];
        Tie& tie = ties_[k];
        tie.pulled_at = share(tie, pair.freed);
        const Vec2 pull = stiffness(tie, tie.pulled_at) * (jump_of(pair, displacement) + tie.stretch);
        force[pair.left] -= pull;
        force[pair.right] += pull;
    }
}

double TipTies::energy(const CrackFields& cracks, std::size_t k, const Motion& motion) const {
    const FieldPair& pair = cracks.pairs[k];
    const Tie& tie = ties_[k];
    if (tie.waits) return 0.0;
    const double f = share(tie, pair.freed);
    const Vec2 here = jump_of(pair, motion.displacement) + tie.stretch;
    const Vec2 rate = jump_of(pair, motion.velocity);
    return 0.5 * stiffness(tie, f) * std::max(0.0, (here - motion.since * rate).dot(here + motion.until * rate)) -
           (1.0 - f) * tie.held;
}

double TipTies::energy(const CrackFields& cracks, const Motion& motion) const {
    double sum = 0.0;
    for (const std::size_t k : live_) sum += energy(cracks, k, motion);
    return sum;
}

std::vector<double> TipTies::energies(const CrackFields& cracks, const std::vector<Vec2>& displacement) const {
    std::vector<double> found(cracks.pairs.size(), 0.0);
    for (const std::size_t k : live_) found[k] = energy(cracks, k, Motion{displacement, displacement});
    return found;
}

bool TipTies::is_of(const CrackFields& cracks, const FieldPair& pair, int crack, bool at_end) {
    if (pair.crack != crack) return false;
    const CrackLine& line = cracks.lines[crack];
    const bool ends = (pair.freed_at - line.end.position).squaredNorm() <= (pair.freed_at - line.start.position).squaredNorm();
    return ends == at_end;
}

bool TipTies::holds(const CrackFields& cracks, int crack, bool at_end) const {
    return std::any_of(live_.begin(), live_.end(), [&](std::size_t k) { return is_of(cracks, cracks.pairs[k], crack, at_end); });
}

std::vector<TipPatch::Tie> TipTies::of_tip(const CrackFields& cracks, int crack, bool at_end) const {
    std::vector<TipPatch::Tie> found;
    for (const std::size_t k : live_)
        if (is_of(cracks, cracks.pairs[k], crack, at_end))
            found.push_back({cracks.pairs[k].node, ties_[k].softness, cracks.pairs[k].freed});
    return found;
}

double TipTies::taken_on(const CrackFields& cracks, int crack, bool at_end, double way, const Motion& motion) const {
    const double width_here = width(cracks.lines[crack].tip(at_end));
    double sum = 0.0;
    for (const std::size_t k : live_) {
        const FieldPair& pair = cracks.pairs[k];
        const Tie& tie = ties_[k];
        if (tie.waits || !is_of(cracks, pair, crack, at_end)) continue;
        const Vec2 here = jump_of(pair, motion.displacement) + tie.stretch;
        const Vec2 rate = jump_of(pair, motion.velocity);
        const Vec2 before = here - motion.since * rate, next = here + motion.until * rate;
        const double from = share(tie, pair.freed);
        const double to = share(tie, pair.freed + way / width_here);
        const double given = 0.5 * (stiffness(tie, from) - stiffness(tie, to)) * std::max(0.0, next.dot(before));
        sum += tie.from_rest ? (1.0 + tie.slack) * given : given - (to - from) * tie.held;
    }
    return sum;
}

double TipTies::balanced_way(const CrackFields& cracks, int crack, bool at_end, const std::function<double(double)>& asked,
                             double most, const Motion& motion) const {
    const auto pays = [&](double way) { return taken_on(cracks, crack, at_end, way, motion) >= asked(way); };
    if (pays(most)) return most;
    double low = 0.0, high = most;
    for (int k = 0; k < 20; ++k) {
        const double middle = 0.5 * (low + high);
        (pays(middle) ? low : high) = middle;
    }
    return low;
}

}  // namespace crampfit
