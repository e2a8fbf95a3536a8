#pragma once

#include "datasets/scene.hpp"

#include <string>
#include <vector>

namespace crampfit {

enum class RunStatus {
    finished,     // a stop condition was met
    split,        // the crack left the specimen
    interrupted,  // the user stopped it
    unstable,     // a quantity became infinite or not a number
};

const char* name(RunStatus status);

/// One saved instant. Force and energies are for the given thickness.
struct Instant {
    double time = 0;             // [s]
    double displacement = 0;     // [m]
    double force = 0;            // [N]
    double crack_length = 0;     // [m]
    Vec2 tip = Vec2::Zero();     // [m]
    double G = 0;                // energy release rate [J/m^2]
    double K_I = 0;              // stress intensity factor, opening [Pa sqrt(m)]
    double K_II = 0;             // stress intensity factor, sliding [Pa sqrt(m)]
    double strain_energy = 0;    // [J]
    double kinetic_energy = 0;   // [J]
    double fracture_energy = 0;  // [J]
    double external_work = 0;    // [J]
};

/// What a further crack did, row by row with the series.
struct CrackHistory {
    std::vector<double> length;  // [m]
    std::vector<Vec2> tip;       // [m]
    std::vector<double> G;       // [J/m^2]
    std::vector<double> K_I;     // [Pa sqrt(m)]
    std::vector<double> K_II;    // [Pa sqrt(m)]
};

/// Total force that each edge and body puts on the specimen, row by row with the series.
struct ReactionHistory {
    std::string name;
    std::vector<Vec2> force;  // [N]
};

/// One place of the crack on the way that it took, whether it stood there or jumped over it: the load at which it moves on from
/// there. In equilibrium only.
struct CriticalLoad {
    double crack_length = 0;  // of the crack that moves on [m]
    Vec2 tip = Vec2::Zero();  // its tip [m]
    double displacement = 0;  // at which it moves on [m]; infinite: it does not
    double force = 0;         // then [N]
    double G = 0;             // energy release rate at the tip, then [J/m^2]
    double toughness = 0;     // mean over the next `advance` [J/m^2]
};

/// The points at one instant. Vectors are per point, in the order of `Record::point_position`.
struct Frame {
    double time = 0;                      // [s]
    double displacement = 0;              // of the measured edge or body [m]
    std::vector<Eigen::Vector2f> moved;   // displacement of each point [m]
    std::vector<Eigen::Vector4f> stress;  // xx, yy, xy, zz [Pa]
    std::vector<Vec2> crack;              // first crack's vertices in the undeformed specimen [m]
};

/// What the probes of a scene read at one instant.
struct ProbeReading {
    std::vector<Vec2> moved;                // displacement of each group of places [m]; not a number where there is no material
    std::vector<std::vector<Vec2>> cracks;  // each crack's vertices then, in the undeformed specimen [m]
};

/// What a run gives.
struct Record {
    RunStatus status = RunStatus::finished;
    std::string message;  // why it ended, for a person
    std::vector<Instant> series;
    std::vector<std::vector<Vec2>> paths;  // of each crack, in the undeformed specimen [m]
    int tracked_crack = 0;                 // whose length, tip, G and K the series holds: an index into `paths`
    std::vector<CrackHistory> cracks;      // every crack but the tracked one, in the scene's order
    std::vector<ReactionHistory> reactions;
    std::vector<CriticalLoad> driving;  // by crack length; the series is what rising displacement makes of it

    std::vector<Vec2> point_position;   // undeformed [m]; filled when frames are asked for
    Vec2 point_size = Vec2::Zero();     // of a point's rectangle, where nothing is cut off it [m]; zero: not known
    std::vector<float> point_latewood;  // 0 first material .. 1 last material, for pictures
    std::vector<Frame> frames;

    std::vector<ProbeReading> probes;  // one an instant asked for; those after the end of the run read as at its end

    std::string scene_text;   // TOML as it was used
    std::string explanation;  // what was modelled, as `crampfit explain` prints it
    long steps = 0;
    long points = 0;
    double seconds = 0;                 // wall time of the run [s]
    double worst_energy_imbalance = 0;  // |work - energies| / largest energy, over the run
};

}  // namespace crampfit
