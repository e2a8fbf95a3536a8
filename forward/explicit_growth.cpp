#include "forward/crack_driving.hpp"
#include "forward/explicit.hpp"
#include "forward/growth.hpp"
#include "forward/loose_pieces.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

namespace {

// A tip that its opening steers asks for its direction anew after this part of a cell.
constexpr double leg_in_cells = 0.25;

// The opening that gives a direction is a mean over the time in which a Rayleigh wave goes so many cells, the reach of J's
// domain: pairs swing as they are freed, and the way of a crack must not hang on in which part of a swing it was asked for.
constexpr double cells_in_mean = 4.0;

// How far a tip may be ahead of a Rayleigh wave. A tip that is held back takes up more than the toughness asks for.
constexpr double most_ahead_in_cells = 1.0;
constexpr std::size_t cells_in_speed = 8;  // over which it is told

// A patch about a tip is good while the tip keeps its direction by 10 degrees.
constexpr double most_turn_cosine = 0.985;

// From here on a turn is sharp [14 degrees]. Chosen: the small ones that an opening asks for from leg to leg cancel, and to set
// each against the way to come made the crossing of TR+ less even over toughness.
constexpr double sharp_turn_cosine = 0.97;

// What sharp turns have given or taken is paid back by this part of the toughness: slowly, lest a tip passes tough wood on
// credit.
constexpr double most_repaid = 0.1;

// Finer cells are asked once what a tip gives up is this part of what it must, and again when that part has become so much
// larger.
constexpr double least_load_for_finer = 0.5, most_rise_for_finer = 1.3;

// In one wood pairs are hardly softer or stiffer than the formula has them: near other cracks and in sharp turns patches say
// more.
constexpr double most_softness_in_one_wood = 1.25;

// Pairs that a crack passes askew give up energy by fits and starts, in shear most: a tip waited where they gave least, until G
// was 1.2 to 1.4 times the toughness, on any grid. In one wood it is balanced over so many cells there, of a crack that goes
// straight: what a patch says of the way straight ahead holds up one that would turn.
constexpr double cells_in_balance = 3.0;
constexpr double askew = 0.02;  // sine times cosine of the angle with the grid [1 degree]

// A shorter way than this part of a cell waits for the next step.
constexpr double least_way_in_cells = 1e-4;

}  // namespace

void ExplicitSolver::grow_cracks() {
    for (int k = 0; k < static_cast<int>(cracks_.lines.size()); ++k)
        for (const bool at_end : {false, true})
            if (cracks_.lines[k].tip(at_end).grows && cracks_.lines[k].tip(at_end).inside) grow(k, at_end);
}

void ExplicitSolver::grow(int crack, bool at_end) {
    const CrackTip& tip = cracks_.lines[crack].tip(at_end);
    Tip& state = tips_[2 * crack + at_end];
    const double cell = body_.layout.cell.minCoeff();
    const LocalWood wood = materials_.at(tip.position);
    // On a grid a tip goes from pair to pair by fits and starts: over some cells it must not outrun the wave.
    const double rayleigh = rayleigh_speed(in_axes(wood.elasticity.stiffness(), tip.direction), wood.density);
    state.allowed = std::min(most_ahead_in_cells * cell, state.allowed + rayleigh * plan_.time_step);

    const GrowthDirection criterion = scene_.cracks[crack].direction;
    if (criterion == GrowthDirection::normal_to_opening) {
        const double share = std::min(1.0, rayleigh * plan_.time_step / (cells_in_mean * cell));
        const Vec2 opening = opening_in_own_frame(body_, cracks_, crack, at_end, displacement_, plan_.rotates);
        state.opening += share * (opening - state.opening);
    }

    const TipTies::Motion motion{displacement_, velocity_, (0.5 + lag()) * plan_.time_step, (0.5 - lag()) * plan_.time_step};
    const double toughness = toughness_to_overcome(crack, at_end, wood.toughness) * body_.layout.thickness;  // [J/m]
    const auto asked = [&](double on) {
        return toughness * on + std::clamp(state.owed, -most_repaid * toughness * on, most_repaid * toughness * on);
    };
    const bool is_held = ties_.holds(cracks_, crack, at_end);
    double way = 0.0;
    if (is_held) way = ties_.balanced_way(cracks_, crack, at_end, asked, state.allowed, motion);
    else if (load_at(crack, at_end).G >= wood.toughness)  // nothing holds it, as in a void: the far field decides, at no cost
        way = std::min(state.allowed, leg_in_cells * cell);
    if (way < least_way_in_cells * cell) return;

    Vec2 direction = tip.direction;
    const bool by_intensities = steered_by_intensities(criterion);
    const double leg = (by_intensities ? least_leg_in_cells(cracks_.lines[crack], at_end) : leg_in_cells) * cell;
    if (state.since_turn >= leg) {
        TipLoad load = load_at(crack, at_end);
        load.opening = state.opening;
        if (!by_intensities) load.K_I = std::numeric_limits<double>::quiet_NaN();  // it swings more than a mean of the opening
        direction = growth_direction(criterion, tip, load, materials_, leg);
        // Waves make K_I and K_II swing: half of a turn is taken, the other half if the next leg still asks for it.
        if (by_intensities && std::isfinite(state.since_turn)) direction = (direction + tip.direction).normalized();
        state.since_turn = 0.0;
    }
    state.since_turn += way;
    state.since_patch += way;
    state.allowed -= way;
    note_speed(state, way);
    // A tip that turns frees pairs otherwise than the balance has seen, and points change sides. What a sharp turn gives or takes
    // is set against what is asked for on the way to come; small ones go to and fro.
    const bool turns_sharply = is_held && direction.dot(tip.direction) < sharp_turn_cosine;
    const double taken = turns_sharply ? ties_.taken_on(cracks_, crack, at_end, way, motion) : 0.0;
    const auto energy = [&] {
        return ties_.energy(cracks_, motion) + (turns_sharply ? internal_force_.energy(displacement_) : 0.0);
    };
    double given = energy();
    if (direction == tip.direction && cracks_.slide(crack, at_end, way)) {
        ties_.take_in(cracks_, mass_, displacement_, false);
    } else {
        double softness = softness_at(crack, at_end, way);
        if (materials_.homogeneous()) softness = std::clamp(softness, 1.0 / most_softness_in_one_wood, most_softness_in_one_wood);
        const Vec2 to = tip.position + way * direction;
        const Box changed = cracks_.window(tip.position, to);
        adopt(cracks_.grow(crack, at_end, to), changed, softness);
    }
    given -= energy();
    books_.fracture += given;
    if (turns_sharply) state.owed += taken - given;
    else if (is_held) state.owed -= std::clamp(given - toughness * way, std::min(0.0, state.owed), std::max(0.0, state.owed));
    if (bridges_) bridges_->take_in(cracks_, mass_);
}

// Of ties to come with the tip so far on.
double ExplicitSolver::softness_at(int crack, bool at_end, double way) {
    const TipPatch& patch = patch_of(crack, at_end);
    const double since = tips_[2 * crack + at_end].since_patch;
    return patch.softness(patch.gone(ties_.of_tip(cracks_, crack, at_end), since - way) + way, displacement_);
}

bool ExplicitSolver::carries_load() const {
    std::vector<Box> pushes;
    for (const int driver : sliding_driver_) {
        const Box at = bounds(scene_.bodies[driver - boundary_.first_body()].shape);
        pushes.push_back({at.low + moved(driver) - body_.layout.cell, at.high + moved(driver) + body_.layout.cell});
    }
    return crampfit::carries_load(body_, cracks_, boundary_, mass_, displacement_, pushes,
                                  [&](std::size_t k) { return bridges_ && bridges_->holds(cracks_, k); });
}

// How far from there edges or bodies hold the specimen or press on it [m].
double ExplicitSolver::held_at(const Vec2& x) const {
    double least = std::numeric_limits<double>::infinity();
    for (const Boundary::Held& held : boundary_.held)
        least = std::min(least, (body_.layout.node_position(cracks_.node_of_field[held.field]) - x).norm());
    for (const int driver : sliding_driver_) {
        const Shape& shape = scene_.bodies[driver - boundary_.first_body()].shape;
        least = std::min(least, nearest_on_outline(shape, x - moved(driver)).distance);
    }
    return least;
}

TipPatch& ExplicitSolver::patch_of(int crack, bool at_end) {
    const CrackTip& tip = cracks_.lines[crack].tip(at_end);
    const double cell = body_.layout.cell.maxCoeff();
    Tip& state = tips_[2 * crack + at_end];
    if (!state.patch || state.since_patch > cell || state.patch_direction.dot(tip.direction) < most_turn_cosine) {
        const double advance = std::max(cell, balanced_over(crack, tip));
        if (!patch_force_) patch_force_.emplace(body_, materials_, false);
        state.patch = std::make_unique<TipPatch>(body_, *patch_force_, cracks_, boundary_, crack, at_end, advance, cell,
                                                 held_at(tip.position));
        state.since_patch = state.finer_at = 0.0;
        state.patch_direction = tip.direction;
    }
    return *state.patch;
}

// The way ahead over which energy is balanced [m].
double ExplicitSolver::balanced_over(int crack, const CrackTip& tip) const {
    const bool is_askew = std::abs(tip.direction.x() * tip.direction.y()) > askew;
    const bool evens = is_askew && scene_.cracks[crack].direction == GrowthDirection::straight && materials_.homogeneous() &&
                       body_.layout.degree == 1 && !plan_.remembers;
    return std::max(scene_.cracks[crack].advance, evens ? cells_in_balance * body_.layout.cell.maxCoeff() : 0.0);
}

// The rate at which the tip must take up energy for the next `advance` to take up its mean toughness [J/m^2].
double ExplicitSolver::toughness_to_overcome(int crack, bool at_end, double here) {
    const CrackTip& tip = cracks_.lines[crack].tip(at_end);
    const double advance = balanced_over(crack, tip);
    if (advance <= body_.layout.cell.maxCoeff()) return here;
    Tip& state = tips_[2 * crack + at_end];
    TipPatch& patch = patch_of(crack, at_end);
    const std::vector<TipPatch::Tie> ties = ties_.of_tip(cracks_, crack, at_end);
    const double gone = patch.gone(ties, state.since_patch);
    const auto [now, mean] = patch.rates(gone, displacement_, ties);
    const double toughness = mean_toughness(materials_, {tip.position, tip.position + advance * tip.direction});
    if (!(mean > 0.0)) return toughness;
    const double load = mean / (toughness * body_.layout.thickness);
    if (load > least_load_for_finer && load > most_rise_for_finer * state.finer_at) {
        patch.take_in(finer_ahead(crack, at_end, patch, gone), gone, displacement_, ties);
        state.finer_at = load;
    }
    return toughness * now / (mean * patch.finer_share(gone));
}

// Nothing where bodies have come near, nor where wood remembers or fibres hold the faces: patches know of neither.
FineTip::Ahead ExplicitSolver::finer_ahead(int crack, bool at_end, const TipPatch& patch, double gone) {
    if (plan_.remembers || bridges_ || body_.layout.degree > 1) return {};
    for (std::size_t b = 0; b < scene_.bodies.size(); ++b) {
        const Box at = bounds(scene_.bodies[b].shape);
        const Vec2 moved_by = moved(boundary_.first_body() + static_cast<int>(b));
        if (patch.box().touches({at.low + moved_by, at.high + moved_by})) return {};
    }
    return fine_tip_.ahead(cracks_, crack, at_end, displacement_, patch.ways_from(gone), patch.box());
}

void ExplicitSolver::note_speed(Tip& state, double way) {
    const double cell = body_.layout.cell.minCoeff();
    state.since_noted += way;
    while (state.since_noted >= cell) {
        state.since_noted = std::isfinite(state.since_noted) ? state.since_noted - cell : 0.0;
        state.noted_at.push_back(time_);
        if (state.noted_at.size() <= cells_in_speed) continue;
        fastest_crack_ = std::max(fastest_crack_, cells_in_speed * cell / (time_ - state.noted_at.front()));
        state.noted_at.pop_front();
    }
}

}  // namespace crampfit
