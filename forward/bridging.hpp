#pragma once

#include "forward/cracks.hpp"

#include <vector>

namespace crampfit {

/// What is left of bridged faces at an opening, per area.
struct BridgeState {
    double traction;    // [Pa]
    double stored;      // that comes back when the faces close [J/m^2]
    double dissipated;  // [J/m^2]
};

/// Of faces that have been open by `largest` and are by `opening` now [m]. They give way by `steepest` at most [Pa/m]: below the opening
/// where the law of `Bridging` would be steeper they hold on to what they carry, as faces do that have not opened yet.
BridgeState bridge_state(const Bridging& law, double steepest, double largest, double opening);

/// Bridged crack faces in motion. Each pair of fields carries the traction on a part of the crack's faces, by its own jump along the
/// normal. New faces go to the pairs that the tip is passing as it frees them, so that bridged faces are as long as the crack has
/// grown; as those pairs have opened already, the tip has to supply what faces that are so far open have taken.
///
/// Faces that have not opened are rigid: they are pulled by the whole stress of the law, and contact keeps them from closing.
class BridgedFaces {
  public:
    /// Bridges may add as much to the squared frequency of a pair that the tip has freed [1/s^2].
    BridgedFaces(const Scene& scene, const Discretisation& body, const CrackFields& cracks, const std::vector<double>& mass,
                 double most_frequency_squared);

    static bool are_in(const Scene& scene);

    /// After a tip has moved or masses have changed. Returns what the new faces have taken [J].
    double take_in(const CrackFields& cracks, const std::vector<double>& mass, const std::vector<Vec2>& displacement);

    /// Adds the tractions to the forces of the fields [N].
    void pull(const CrackFields& cracks, const std::vector<Vec2>& displacement, std::vector<Vec2>& force);

    /// Adds the last tractions to what faces put on the left one of each pair [pairs] [N].
    void add_to(std::vector<Vec2>& faces, const CrackFields& cracks) const;

    /// What new faces at a tip have taken once they are there, per area [J/m^2].
    double price_of_new_faces(const CrackFields& cracks, int crack, bool at_end, const std::vector<Vec2>& displacement) const;

    struct Energies {
        double stored = 0, dissipated = 0;  // [J]
    };
    Energies energies(const CrackFields& cracks, const std::vector<Vec2>& displacement) const;

  private:
    struct Bridge {
        double area = 0;      // [m^2]
        double share = 0;     // weight among the pairs that a tip passes
        double freed = 0;     // by the tip so far, 0..1
        double stiffest = 0;  // [N/m]
        double largest = 0;   // opening so far [m]
        double force = 0;     // that pulled the faces together last [N]
    };
    void lay_on_faces(int crack, const CrackFields& cracks);
    BridgeState state(const CrackFields& cracks, std::size_t pair, const std::vector<Vec2>& displacement) const;

    const Scene& scene_;
    const Discretisation& body_;
    double most_frequency_squared_;       // [1/s^2]
    std::vector<Bridge> bridges_;         // [pairs]
    std::vector<std::size_t> live_;       // of them those that have faces
    std::vector<double> length_;          // [cracks] as last seen [m]
    std::vector<double> still_to_share_;  // [cracks] new faces while no pair was being freed [m^2]
};

} // namespace crampfit
