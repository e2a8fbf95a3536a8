#pragma once

#include "forward/discretisation.hpp"

#include <limits>
#include <optional>
#include <string>
#include <vector>

namespace crampfit {

/// How what is measured as displacement is driven.
struct Drive {
    double speed = 0;  // [m/s]
    double until = 0;  // then it holds still [s]; infinite: never

    bool comes_to(double displacement) const { return displacement <= speed * until * (1.0 + 1e-9); }
};

/// Absent where it stands, or moves by a force alone.
std::optional<Drive> measured_drive(const Scene& scene);

/// When the run ends at the latest, by the stop conditions on time and on a displacement that is prescribed [s]; infinite:
/// neither ends it.
double end_time(const Scene& scene);

/// Whether some stop condition may be met in the end.
bool may_end(const Scene& scene);

/// The farthest that any edge or body goes until then [m]; infinite where nothing bounds it.
double farthest_motion(const Scene& scene, double end);

/// How far the edges of a strip go until a long crack runs through it, G = E eps^2 h (REFERENCES: strip) with the toughest wood's
/// toughness and the softest wood's stiffness, and half as far again for arrests [m].
double splitting_motion(const Scene& scene, const Discretisation& body);

/// Whether bodies without friction alone, or nothing, hold the specimen along an axis.
bool slides_along(const Scene& scene, int axis);

/// What to say besides where no equilibrium is found: that along some axis frictionless bodies alone hold the specimen; else
/// empty.
std::string advice_on_holds(const Scene& scene);

/// What an end without equilibrium says where friction holds the specimen.
inline constexpr const char* friction_may_slip = "; the load may be more than friction can hold";

/// Whether there is a traction, or a force on a body, which do not go with time.
bool has_dead_load(const Scene& scene);

/// What moves, how fast, until when.
struct Travel {
    double fastest = 0.0;                                    // [m/s]
    double until = std::numeric_limits<double>::infinity();  // all stand still from then on [s]
    std::vector<double> stops;                               // of some, while others go on [s]
};

Travel travel_of(const Scene& scene);

}  // namespace crampfit
