#pragma once

#include "datasets/record.hpp"
#include "forward/quasistatic.hpp"
#include "forward/recorder.hpp"

namespace crampfit {

/// What probes at these places read [m]: the displacement of the grid, by its shape functions, of the fields on the place's own side of
/// each crack.
ProbeReading read_probes(const std::vector<Vec2>& places, const Discretisation& body, const CrackFields& cracks,
                         const std::vector<Vec2>& displacement);

/// The row of a record's series at a time [s], or at a displacement [m] where it is first reached: linear between rows, the last row after
/// the end.
Instant instant_at(const std::vector<Instant>& series, double at, bool by_displacement);

/// The equilibria of a walk that a record has rows of. A walk keeps no displacements: each is solved for anew, with the cracks as they
/// were then.
class Revisit {
  public:
    /// All of them must outlive this.
    Revisit(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk);

    /// Goes to an instant, no earlier than the last one. False where there is no equilibrium.
    bool to(const Instant& instant);

    const Discretisation& body() const { return body_; }
    const Equilibrium& equilibrium() const { return equilibrium_; }

  private:
    void grow(const Vec2& to, int crack, bool at_end);

    Quasistatic& walk_;
    Discretisation body_;
    Equilibrium equilibrium_;
    TrackedTip tracked_;
    std::size_t station_ = 0;
};

/// Fills `record.probes` with what the scene's probes read on the walk whose series the record has; where the plan has a second grid, made
/// better by it.
void read_probes(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk, Record& record);

} // namespace crampfit
