#pragma once

#include "datasets/record.hpp"
#include "forward/energy_release.hpp"

#include <vector>

namespace crampfit {

/// One equilibrium: one crack length at one time of the loading.
struct LoadState {
    double time = 0;                // [s]
    double potential = 0;           // Pi: energy of the specimen less the work of tractions [J]
    double power = 0;               // dPi/dt while the crack stands: of what prescribes motion [W]
    double traction_work = 0;       // of tractions since there was no load [J]
    double displacement = 0;        // of the measured edge or body [m]
    std::vector<Vec2> reactions;    // [drivers] [N]
    std::vector<TipLoad> tips;      // two a crack: start, end
};

/// The same equilibrium at another load, where everything goes linearly with the load from none on.
LoadState scaled(const LoadState& state, double factor);

/// A crack length and what is known of it: equilibria at several times, and how much energy the next `advance` would release.
struct Station {
    std::vector<std::array<Vec2, 2>> tips;  // [cracks] start, end [m]
    std::vector<double> lengths;            // [cracks] [m]
    bool split = false;                     // every growing tip has reached a free surface
    int crack = -1;                         // the tip that moves on from here; -1: none can
    bool at_end = true;
    std::vector<Vec2> route;                // where it goes over the next `advance`, from its tip on; only the tip for advance 0
    double thickness = 0;                   // [m]
    std::vector<LoadState> states;          // by rising time; in a linear scene three, which say all
    std::vector<std::array<double, 2>> ahead;  // [states] potential [J] and power [W] with the tip at the route's end

    double route_length() const;            // [m]
};

/// Everything that a sweep over the crack length found. Toughness has no part in it but for the route that the crack took.
struct CrackDriving {
    bool linear = true;                     // displacements go linearly with the load
    double still_from = 0;                  // nothing moves any more from this time on [s]; infinite: never
    std::vector<Station> stations;          // along the way of the crack(s)

    /// What a station is like at a time. In a linear scene exact; else between the states that are there.
    LoadState at(const Station& station, double time) const;

    /// The first time at which the next advance releases as much energy as it costs, with `toughness` the mean over the route
    /// [J/m^2]; infinite when it never does [s].
    double critical_time(const Station& station, double toughness) const;
};

/// What two walks over the same stations, on a grid and on one with cells twice as wide, tell of one with cells of no width: errors go
/// with the square of the cell, so that a third of the difference is left (Richardson 1911). G and K at the tips stay as they are.
CrackDriving extrapolated(const CrackDriving& fine, const CrackDriving& coarse);

/// Mean toughness of the wood along a route; of one place, at it [J/m^2].
double mean_toughness(const MaterialMap& materials, const std::vector<Vec2>& route);

} // namespace crampfit
