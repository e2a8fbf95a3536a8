#include "forward/probes.hpp"

#include "forward/geometry.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

namespace crampfit {

ProbeReading read_probes(const std::vector<Vec2>& places, const Discretisation& body, const CrackFields& cracks,
                         const std::vector<Vec2>& displacement) {
    const Layout& layout = body.layout;
    ProbeReading reading;
    for (const Vec2& place : places) {
        Vec2 moved = Vec2::Zero();
        if (body.point_at(place) < 0) {
            moved.setConstant(std::numeric_limits<double>::quiet_NaN());
        } else {
            const auto weights = body.values_at(layout.cell_at(place), place);
            const auto fields = cracks.fields_at(place);
            for (int k = 0; k < layout.nodes_per_cell(); ++k) moved += weights[k] * displacement[fields[k]];
        }
        reading.moved.push_back(moved);
    }
    for (const CrackLine& line : cracks.lines) reading.cracks.push_back(line.points);
    return reading;
}

SeriesPlace place_in(const std::vector<Instant>& series, double at, bool by_displacement) {
    const auto value = [&](const Instant& row) { return by_displacement ? row.displacement : row.time; };
    const auto after = std::find_if(series.begin(), series.end(), [&](const Instant& row) { return value(row) >= at; });
    if (after == series.end()) return {series.size() - 1, 0.0};
    if (after == series.begin()) return {};
    const Instant& before = *std::prev(after);
    return {static_cast<std::size_t>(after - series.begin()) - 1, (at - value(before)) / (value(*after) - value(before))};
}

Revisit::Revisit(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk)
    : walk_(walk), body_(scene, materials), equilibrium_(scene, plan, materials, body_) {}

namespace {

// Length of a crack of the scene at a row of the series [m].
double length_at(const Record& record, int crack, std::size_t row) {
    if (crack == record.tracked_crack) return record.series[row].crack_length;
    return record.cracks[crack - (crack > record.tracked_crack)].length[row];
}

std::size_t next_row(const Record& record, const SeriesPlace& place) { return std::min(place.row + 1, record.series.size() - 1); }

double time_at(const Record& record, const SeriesPlace& place) {
    return std::lerp(record.series[place.row].time, record.series[next_row(record, place)].time, place.share);
}

} // namespace

// Moves the tips that move on from the station by this share of the way to the next.
void Revisit::grow(double share) {
    for (const auto& [crack, at_end, route] : walk_.station(station_).moving) {
        const Vec2& start = walk_.station(station_).tips[crack][at_end];
        const Vec2 to = start + share * (walk_.station(station_ + 1).tips[crack][at_end] - start);
        const CrackTip& tip = equilibrium_.cracks().lines[crack].tip(at_end);
        if (tip.inside && (to - tip.position).norm() > 1e-6 * body_.layout.cell.minCoeff()) equilibrium_.grow(crack, at_end, to);
    }
}

// How much of the way from the station to the next the cracks have gone.
double Revisit::share_gone(const Record& record, const SeriesPlace& place) {
    if (walk_.station(station_).left || !walk_.reach(station_ + 1, time_at(record, place))) return 0.0;
    double least = 1.0;
    for (const auto& [crack, at_end, route] : walk_.station(station_).moving) {
        const double length = std::lerp(length_at(record, crack, place.row), length_at(record, crack, next_row(record, place)), place.share);
        const double here = walk_.station(station_).lengths[crack];
        const double grown = walk_.station(station_ + 1).lengths[crack] - here;
        if (length < here + grown) least = std::min(least, std::max(0.0, (length - here) / grown));
    }
    return least > 1.0 - 1e-9 ? 1.0 : least;
}

bool Revisit::to(const Record& record, const SeriesPlace& place) {
    while (share_gone(record, place) == 1.0) {
        grow(1.0);
        ++station_;
    }
    if (const double share = share_gone(record, place); share > 0.0) grow(share);
    return equilibrium_.solve(time_at(record, place)) == Equilibrium::Outcome::solved;
}

namespace {

Scene with_wide_cells(Scene scene) {
    scene.model.cell *= 2.0;
    return scene;
}

// The same walk on cells twice as wide.
struct WideRevisit {
    WideRevisit(const Scene& fine, const Plan& plan, Quasistatic& walk)
        : scene(with_wide_cells(fine)), materials(scene), revisit(scene, plan, materials, walk) {}

    Scene scene;
    MaterialMap materials;
    Revisit revisit;
};

double distance_to(const std::vector<Vec2>& line, const Vec2& x) {
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t k = 0; k + 1 < line.size(); ++k)
        least = std::min(least, (line[k] + nearest_on_segment(line[k], line[k + 1], x) * (line[k + 1] - line[k]) - x).norm());
    return least;
}

// Takes off a third of the difference to the wider grid, as for all else of an equilibrium (`extrapolate`). Not beside a crack, where
// the wide grid knows next to nothing.
void extrapolate(ProbeReading& fine, const ProbeReading& wide, const std::vector<Vec2>& places, double wide_cell) {
    for (std::size_t i = 0; i < places.size(); ++i) {
        const bool beside = std::any_of(fine.cracks.begin(), fine.cracks.end(), [&](const auto& line) { return distance_to(line, places[i]) < 2.0 * wide_cell; });
        if (!beside && wide.moved[i].allFinite()) fine.moved[i] += (fine.moved[i] - wide.moved[i]) / 3.0;
    }
}

ProbeReading read_probes(const std::vector<Vec2>& places, const Revisit& revisit) {
    return read_probes(places, revisit.body(), revisit.equilibrium().cracks(), revisit.equilibrium().displacements());
}

} // namespace

void read_probes(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk, Record& record) {
    const Probes& probes = scene.output.probes;
    if (probes.places.empty()) return;
    Revisit revisit(scene, plan, materials, walk);
    std::optional<WideRevisit> wide;
    if (plan.extrapolates) wide.emplace(scene, plan, walk);
    for (const double at : probes.instants) {
        const SeriesPlace place = place_in(record.series, at, probes.by_displacement);
        if (!revisit.to(record, place)) return;
        ProbeReading& reading = record.probes.emplace_back(read_probes(probes.places, revisit));
        if (wide && wide->revisit.to(record, place))
            extrapolate(reading, read_probes(probes.places, wide->revisit), probes.places, wide->revisit.body().layout.cell.maxCoeff());
    }
}

} // namespace crampfit
