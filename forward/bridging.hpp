#pragma once

#include "forward/face_normals.hpp"

#include <vector>

namespace crampfit {

/// What is left of bridged faces at an opening, per area.
struct BridgeState {
    double traction;    // [Pa]
    double stored;      // that comes back when the faces close [J/m^2]
    double dissipated;  // [J/m^2]
};

/// Of faces that have been open by `largest` and are by `opening` now [m]. They give way by `steepest` at most [Pa/m]: below the
/// opening where the law of `Bridging` would be steeper they hold on to what they carry, as faces do that have not opened yet.
BridgeState bridge_state(const Bridging& law, double steepest, double largest, double opening);

/// Bridged crack faces in motion. Each pair of fields carries the traction on a part of the crack's faces, by its own jump along
/// the normal as the wood has turned: that part of the crack's length on which its shape function stands for the jump. Faces that
/// have not opened are rigid: the whole stress of the law pulls on them, and contact keeps them from closing. So a pair that a
/// tip comes to is bridged before the tip frees it, which takes no energy, and what the tip gives up while it passes is what is
/// left for it by the bridges. Where the faces of the start are not bridged nor are pairs that the tip has begun to free by then:
/// growth begins at the toughness of the tip.
class BridgedFaces {
  public:
    /// Bridges may add as much to the squared frequency of a pair that the tip has freed [1/s^2].
    BridgedFaces(const Scene& scene, const Discretisation& body, const CrackFields& cracks, const std::vector<double>& mass,
                 double most_frequency_squared);

    static bool are_in(const Scene& scene);

    /// What the compliance of ties at the pairs that a tip has just come to must be multiplied by, beyond `softness` of TipPatch.
    /// With c the compliance of a free pair and k the slope of its softening bridges it opens as one of 1 / c - k; the tie of
    /// CrackFields for that one lets the energy go linearly with the tip again.
    double softer_ties(const CrackFields& cracks, double softness) const;

    /// After a tip has moved or masses have changed.
    void take_in(const CrackFields& cracks, const std::vector<double>& mass);

    /// Adds the tractions to the forces of the fields [N].
    void pull(const CrackFields& cracks, const FaceNormals& normals, const std::vector<Vec2>& displacement,
              std::vector<Vec2>& force);

    /// Adds the last tractions to what faces put on the left one of each pair [pairs] [N].
    void add_to(std::vector<Vec2>& faces, const FaceNormals& normals) const;

    /// Whether the faces of a pair still pull on each other, or will.
    bool holds(const CrackFields& cracks, std::size_t pair) const;

    struct Energies {
        double stored = 0, dissipated = 0;  // [J]
    };
    Energies energies(const CrackFields& cracks, const FaceNormals& normals, const std::vector<Vec2>& displacement) const;

  private:
    struct Bridge {
        double area = 0;      // [m^2]
        double stiffest = 0;  // [N/m]
        double largest = 0;   // opening so far [m]
        double force = 0;     // that pulled the faces together last [N]
    };
    void bridge_notch(int crack, const CrackFields& cracks, const std::vector<double>& mass);
    double area_ahead(const CrackFields& cracks, const FieldPair& pair) const;
    bool is_cut(int node, const Vec2& on_crack, const Vec2& along) const;
    BridgeState state(const FieldPair& pair, const Bridge& bridge, double opening) const;

    const Scene& scene_;
    const Discretisation& body_;
    double most_frequency_squared_;  // [1/s^2]
    std::vector<Bridge> bridges_;    // [pairs]
    std::vector<std::size_t> live_;  // of them those that have faces
};

}  // namespace crampfit
