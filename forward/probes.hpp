#pragma once

#include "datasets/record.hpp"
#include "forward/quasistatic.hpp"

namespace crampfit {

/// What probes read in each of some displacement fields [fields x readings] [m]: the displacement of the grid, by its shape
/// functions, of the fields on the place's own side of each crack.
std::vector<std::vector<Vec2>> read_probes(const Probes& probes, const Discretisation& body, const CrackFields& cracks,
                                           const std::vector<const std::vector<Vec2>*>& displacements);

/// The same in one field, with the cracks as they are.
ProbeReading read_probes(const Probes& probes, const Discretisation& body, const CrackFields& cracks,
                         const std::vector<Vec2>& displacement);

/// A place between a row of a record's series and the next.
struct SeriesPlace {
    std::size_t row = 0;
    double share = 0;  // of the way to the next row, 0..1
};

/// Where a series comes to a time [s], or first to a displacement [m]; its last row where it ends before.
SeriesPlace place_in(const std::vector<Instant>& series, double at, bool by_displacement);

/// Where on its walk a record is.
class WayFinder {
  public:
    /// The walk must outlive this.
    explicit WayFinder(Quasistatic& walk) : walk_(walk) {}

    /// Goes to a place of the walk's record, no earlier than the last one.
    void to(const Record& record, const SeriesPlace& place);

    std::size_t station() const { return station_; }
    double share() const { return share_; }  // of the way to the next station that the cracks have gone, below 1

  private:
    double share_gone(const Record& record, const SeriesPlace& place);

    Quasistatic& walk_;
    std::size_t station_ = 0;
    double share_ = 0;
};

/// The equilibria of a walk that a record has rows of. A walk keeps no displacements: each is solved for anew, with the cracks as
/// they were then.
class Revisit {
  public:
    /// All of them must outlive this, but for `body`: the specimen at rest, without cracks.
    Revisit(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body, Quasistatic& walk);

    /// Goes to a place of the walk's record, no earlier than the last one. False where there is no equilibrium.
    bool to(const Record& record, const SeriesPlace& place);

    const Discretisation& body() const { return body_; }
    const Equilibrium& equilibrium() const { return equilibrium_; }

  private:
    void grow(double share);

    Quasistatic& walk_;
    WayFinder finder_;
    Discretisation body_;
    Equilibrium equilibrium_;
    std::size_t station_ = 0;
};

/// Fills `record.probes` with what the scene's probes read on the walk whose series the record has, between its stations by
/// interpolation as all else of the series.
void read_probes(const Scene& scene, Quasistatic& walk, Record& record);

}  // namespace crampfit
