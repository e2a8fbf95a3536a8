#pragma once

#include "datasets/record.hpp"
#include "forward/quasistatic.hpp"

namespace crampfit {

/// What probes at these places read [m]: the displacement of the grid, by its shape functions, of the fields on the place's own side of
/// each crack.
ProbeReading read_probes(const std::vector<Vec2>& places, const Discretisation& body, const CrackFields& cracks,
                         const std::vector<Vec2>& displacement);

/// A place between a row of a record's series and the next.
struct SeriesPlace {
    std::size_t row = 0;
    double share = 0;  // of the way to the next row, 0..1
};

/// Where a series comes to a time [s], or first to a displacement [m]; its last row where it ends before.
SeriesPlace place_in(const std::vector<Instant>& series, double at, bool by_displacement);

/// The equilibria of a walk that a record has rows of. A walk keeps no displacements: each is solved for anew, with the cracks as they
/// were then.
class Revisit {
  public:
    /// All of them must outlive this. The scene's cells may be others than the walk's.
    Revisit(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk);

    /// Goes to a place of the walk's record, no earlier than the last one. False where there is no equilibrium.
    bool to(const Record& record, const SeriesPlace& place);

    const Discretisation& body() const { return body_; }
    const Equilibrium& equilibrium() const { return equilibrium_; }

  private:
    double share_gone(const Record& record, const SeriesPlace& place);
    void grow(double share);

    Quasistatic& walk_;
    Discretisation body_;
    Equilibrium equilibrium_;
    std::size_t station_ = 0;
};

/// Fills `record.probes` with what the scene's probes read on the walk whose series the record has; where the plan has a second grid, made
/// better by it.
void read_probes(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk, Record& record);

} // namespace crampfit
