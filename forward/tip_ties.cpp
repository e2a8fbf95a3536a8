#include "forward/tip_ties.hpp"

#include <algorithm>
#include <cmath>

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
    for (std::size_t k = 0; k < ties_.size(); ++k) {
        const FieldPair& pair = cracks.pairs[k];
        Tie& tie = ties_[k];
        const double left = mass[pair.left];
        const double right = mass[pair.right];
        if (k >= known) {
            tie.waits = !at_rest;
            tie.softness = softness;
            if (!at_rest) tie.from = std::max(0.0, pair.freed);
            tie.pulled_at = share(tie, pair.freed);
        }
        if (pair.freed >= 1.0 || left == 0.0 || right == 0.0 || !std::isfinite(pair.compliance)) continue;
        live_.push_back(k);
        // A crack between two rows of nodes has a pair on either: they share the tie as they share the mass beyond the crack.
        const double shared = 4.0 * left * right / ((left + right) * (left + right));
        const double f = share(tie, pair.freed);
        const Vec2 jump = jump_of(pair, displacement);
        if (k < known && tie.compliance == 0.0) tie.waits = true;  // there was no wood on one side
        // A tip that has turned back to the beginning of the way past a pair would be held by a rigid tie: then by the last one.
        const double held_at = f + tie.slack > 0.0 ? f : tie.pulled_at;
        const Vec2 before = k < known && !tie.waits ? Vec2(stiffness(tie, held_at) * (jump + tie.stretch)) : Vec2(Vec2::Zero());
        const double compliance = tie.softness * pair.compliance / shared;
        const double most = most_frequency_squared_ * left * right / (left + right);
        const double slack = std::max(k < known ? tie.slack : 0.0, (1.0 - f) / (most * compliance) - f);
        if (slack == tie.slack && compliance == tie.compliance) continue;
        tie.compliance = compliance;
        tie.slack = slack;
        if (k < known && !tie.waits) tie.stretch = before / stiffness(tie, f) - jump;  // goes on with the same force
    }
}

void TipTies::settle(const CrackFields& cracks, const std::vector<double>& mass, const std::vector<Vec2>& force) {
    for (const std::size_t k : live_) {
        Tie& tie = ties_[k];
        if (!tie.waits) continue;
        const FieldPair& pair = cracks.pairs[k];
        const double left = mass[pair.left];
        const double right = mass[pair.right];
        Vec2 held = (right * force[pair.left] - left * force[pair.right]) / (left + right);  // both sides go on alike
        held -= std::min(0.0, held.dot(pair.normal)) * pair.normal;                          // pressure is left to the faces
        tie.stretch = tie.slack * tie.compliance * held;
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

double TipTies::energy(const CrackFields& cracks, const std::vector<Vec2>& displacement, const std::vector<Vec2>& velocity,
                       double since, double until) const {
    double sum = 0.0;
    for (const std::size_t k : live_) {
        const FieldPair& pair = cracks.pairs[k];
        const Tie& tie = ties_[k];
        if (tie.waits) continue;
        const double f = share(tie, pair.freed);
        const Vec2 here = jump_of(pair, displacement) + tie.stretch;
        const Vec2 rate = velocity.empty() ? Vec2(Vec2::Zero()) : jump_of(pair, velocity);
        sum += 0.5 * stiffness(tie, f) * std::max(0.0, (here - since * rate).dot(here + until * rate));
        if (tie.slack > 0.0) sum -= 0.5 * (1.0 - f) * tie.stretch.squaredNorm() / (tie.slack * tie.compliance);
    }
    return sum;
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

double TipTies::balanced_way(const CrackFields& cracks, int crack, bool at_end, double toughness, double most,
                             const std::vector<Vec2>& displacement, const std::vector<Vec2>& velocity, double since,
                             double until) const {
    const double width_here = width(cracks.lines[crack].tip(at_end));
    const auto taken_on = [&](double way) {  // [J]
        double sum = 0.0;
        for (const std::size_t k : live_) {
            const FieldPair& pair = cracks.pairs[k];
            const Tie& tie = ties_[k];
            if (tie.waits || !is_of(cracks, pair, crack, at_end)) continue;
            const Vec2 here = jump_of(pair, displacement) + tie.stretch;
            const Vec2 rate = velocity[pair.left] - velocity[pair.right];
            const Vec2 before = here - since * rate, next = here + until * rate;
            const double from = share(tie, pair.freed);
            const double to = share(tie, pair.freed + way / width_here);
            sum += 0.5 * (stiffness(tie, from) - stiffness(tie, to)) * std::max(0.0, next.dot(before));
            if (tie.slack > 0.0) sum -= 0.5 * (to - from) * tie.stretch.squaredNorm() / (tie.slack * tie.compliance);
        }
        return sum;
    };
    const auto asked_on = [&](double way) { return toughness * thickness_ * way; };
    if (taken_on(most) >= asked_on(most)) return most;
    double low = 0.0, high = most;
    for (int k = 0; k < 20; ++k) {
        const double middle = 0.5 * (low + high);
        (taken_on(middle) > asked_on(middle) ? low : high) = middle;
    }
    return low;
}

}  // namespace crampfit
