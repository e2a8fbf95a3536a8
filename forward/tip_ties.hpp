#pragma once

#include "forward/face_normals.hpp"
#include "forward/tip_patch.hpp"

#include <functional>
#include <vector>

namespace crampfit {

/// What holds the pairs of fields together that a crack tip is passing, in motion; and by that the energy that the tip takes up.
///
/// With c the compliance of a free pair and f the share of its way past the pair that the tip has gone, a tie of stiffness (1 -
/// f) / (f c) lets the specimen give up its energy linearly in f (CrackFields). An explicit time step cannot afford it at small
/// f. So a tie here has a slack compliance s c in series, stretched from the start by the force F0 that held the node together
/// before:
///     force = (1 - f) / ((f + s) c) (jump + s c F0),
/// F0 at f = 0 and without jump. Under a load that stays, with jump = c (F0 - force), the force is F0 (1 - f), as without slack:
/// the pair opens as a linearly softening cohesive crack that is rigid before (Camacho and Ortiz 1996; continuous in time as
/// Papoulia, Sam and Vavasis 2003 ask). Its energy, with what the slack held at the start taken off,
///     W = (1 - f) / 2 [ |jump + s c F0|^2 / ((f + s) c) - s c F0^2 ],
/// is the only thing in a running specimen that depends on where the tip is, so that - dW/da is the energy release rate, exactly.
/// A tie that stands from the start of a run, with F0 = 0, yields by its slack while the load rises, which gives up s / (1 + s)
/// of that energy before the tip moves: as what the tip takes up that part counts too. (Of a tie that was loaded before, a load
/// that rises while the tip stands gives up nothing to first order.)
class TipTies {
  public:
    /// A tie may add as much to the squared frequency of its pair [1/s^2].
    TipTies(const Vec2& cell, double thickness, double most_frequency_squared)
        : cell_(cell), thickness_(thickness), most_frequency_squared_(most_frequency_squared) {}

    /// After a tip has moved or masses have changed. Pairs that are new are held by what holds them now, from the next `pull` on;
    /// those of the start of a run (`at_rest`) by nothing yet. `softness` is that of TipPatch, for new pairs.
    void take_in(const CrackFields& cracks, const std::vector<double>& mass, const std::vector<Vec2>& displacement, bool at_rest,
                 double softness = 1.0);

    /// Lets the ties that are new hold their pairs together under these forces of the fields [N].
    void settle(const CrackFields& cracks, const FaceNormals& normals, const std::vector<double>& mass,
                const std::vector<Vec2>& force);

    /// Adds the ties' forces to those of the fields [N].
    void pull(const CrackFields& cracks, const std::vector<Vec2>& displacement, std::vector<Vec2>& force);

    /// Of the fields, and when the forces are and were: `until` [s] ahead and `since` [s] back by the velocities.
    struct Motion {
        const std::vector<Vec2>& displacement;  // [m]
        const std::vector<Vec2>& velocity;      // [m/s]; any where the times are nil
        double since = 0.0, until = 0.0;
    };

    double energy(const CrackFields& cracks, const std::vector<Vec2>& displacement) const {  // [J]
        return energy(cracks, Motion{displacement, displacement});
    }

    /// Of each pair of fields [J].
    std::vector<double> energies(const CrackFields& cracks, const std::vector<Vec2>& displacement) const;

    /// The same as central differences have it [J]: over a step in which a tie's stiffness k changes, their energy changes by -
    /// dk/2 times the stretch at the next forces times that at the last.
    double energy(const CrackFields& cracks, const Motion& motion) const;

    /// What a tip takes up on its straight way on [J], by that energy.
    double taken_on(const CrackFields& cracks, int crack, bool at_end, double way, const Motion& motion) const;

    /// How far a tip goes straight on, up to `most` [m], until it has taken up what is asked for on its way [m to J]: more than
    /// that where `most` ends the way.
    double balanced_way(const CrackFields& cracks, int crack, bool at_end, const std::function<double(double)>& asked,
                        double most, const Motion& motion) const;

    /// Whether it is this tip that frees the pair.
    static bool is_of(const CrackFields& cracks, const FieldPair& pair, int crack, bool at_end);
    bool holds(const CrackFields& cracks, int crack, bool at_end) const;

    /// Those of a tip.
    std::vector<TipPatch::Tie> of_tip(const CrackFields& cracks, int crack, bool at_end) const;

  private:
    struct Tie {
        bool waits = false;     // for the force that it starts with
        double from = 0;        // share of the way that the tip had gone when the tie came up
        double pulled_at = 0;   // and since then, when it pulled last: a crack that turns may have less of it
        double compliance = 0;  // c [m/N]
        double slack = 0;       // s
        double softness = 1;
        Vec2 begun_at = Vec2::Zero();  // jump when it came up, where another crack had opened the pair [m]
        bool from_rest = false;        // held by nothing when it came up
        Vec2 stretch = Vec2::Zero();   // s c F0 less that jump [m]
        double held = 0;               // by the slack at the start, s c F0^2 / 2 [J]
    };
    double energy(const CrackFields& cracks, std::size_t pair, const Motion& motion) const;
    double share(const Tie& tie, double freed) const;
    double stiffness(const Tie& tie, double f) const;
    double width(const CrackTip& tip) const;
    Vec2 cell_;                      // [m]
    double thickness_;               // [m]
    double most_frequency_squared_;  // [1/s^2]
    std::vector<Tie> ties_;          // [pairs]
    std::vector<std::size_t> live_;  // of them those that hold
};

}  // namespace crampfit
