#pragma once

#include "datasets/record.hpp"
#include "forward/energy_release.hpp"

#include <map>
#include <vector>

namespace crampfit {

/// One equilibrium: one crack length at one time of the loading.
struct LoadState {
    double time = 0;           // [s]
    double potential = 0;      // Pi: energy of the specimen less the work of tractions, and what friction has dissipated [J]
    double power = 0;          // dPi/dt while the crack stands: of what prescribes motion [W]
    double traction_work = 0;  // of tractions and forces on bodies since there was no load [J]
    // Both again as the end of an advance, to be compared with its start: what the grid misses at tips near.
    double end_potential = 0;
    double end_power = 0;     // sharp boundaries is that of the boxes that stand about the tips of the start (`FineTip`) [J], [W]
    double dissipated = 0;    // by friction [J]
    double displacement = 0;  // of the measured edge or body [m]
    std::vector<Vec2> reactions;  // [drivers] [N]
    std::vector<TipLoad> tips;    // two a crack: start, end

    /// What it is roughly like at another time, if the potential goes as the power of the time that its slope says.
    LoadState gone_on(double to) const;
};

/// The same equilibrium at another load, where everything goes linearly with the load from none on.
LoadState scaled(const LoadState& state, double factor);

/// Takes off a third of the difference to a grid with cells twice as wide, all but G and K.
void extrapolate(LoadState& fine, const LoadState& coarse);

/// What lies between two equilibria of the same crack, at a time.
LoadState between(const LoadState& from, const LoadState& to, double time);

/// A tip that moves on from a place, and where it goes over the next `advance`, from the tip on; only the tip for advance 0 [m].
struct MovingTip {
    int crack;
    bool at_end;
    std::vector<Vec2> route;
};

/// A crack length and what is known of it: equilibria at several times, and how much energy the next `advance` would release.
struct Station {
    std::vector<std::array<Vec2, 2>> tips;       // [cracks] start, end [m]
    std::vector<double> lengths;                 // [cracks] [m]
    bool left = false;                           // no tip can grow: each has reached a free surface, or none was to grow
    bool grows = false;                          // some tip was to grow
    std::vector<MovingTip> moving;               // the tips that move on from here, together; empty: none can
    double thickness = 0;                        // [m]
    bool linear = true;                          // goes linearly with the load: three states say all
    double still_from = 0;                       // nothing moves any more from this time on [s]; infinite: never
    std::map<int, LoadState> states;             // by number of the time
    std::map<int, std::array<double, 2>> ahead;  // the same: potential [J] and power [W] with the tips at their routes' ends

    double route_length() const;  // of all tips that move [m]

    /// Every growing tip has reached a free surface.
    bool split() const { return left && grows; }

    /// True where both sides of the balance are known at a time.
    bool ahead_known(int time) const { return states.count(time) && (route_length() == 0.0 || ahead.count(time)); }

    /// What it is like at a time: in a linear scene exact, else between the two states about it, which must be there.
    LoadState at(double time) const;

    /// The first time at which the next advance releases as much energy as it costs, with `toughness` the mean over the routes
    /// [J/m^2], between what is known; infinite where it does not within that [s]. `beyond` it: the energy released goes on as a
    /// power of the time.
    double critical_time(double toughness, bool beyond = false) const;

    /// How far the load is on its way to there at a time: the root of what the next advance releases over what it costs, which
    /// goes evenly with the load. Where what lies ahead is not known, of G at the tip.
    double share_of_critical(double toughness, double time) const;
};

/// Mean toughness of the wood along a route; of one place, at it [J/m^2].
double mean_toughness(const MaterialMap& materials, const std::vector<Vec2>& route);

/// The same over the routes of all tips that move.
double mean_toughness(const MaterialMap& materials, const std::vector<MovingTip>& moving);

}  // namespace crampfit
