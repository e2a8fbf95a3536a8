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
            // A point's domain never leaves its cell, where its averaged shape functions are the hats at its middle: hats, then.
            const Vec2 corner = layout.cell_corner(layout.cell_at(place));
            const CellWeights weights = cell_weights(ShapeFunction::linear, place - corner, layout.cell, {});
            const std::array<int, 4> fields = cracks.fields_at(place);
            for (int k = 0; k < 4; ++k) moved += weights.value[k] * displacement[fields[k]];
        }
        reading.moved.push_back(moved);
    }
    for (const CrackLine& line : cracks.lines) reading.cracks.push_back(line.points);
    return reading;
}

Instant instant_at(const std::vector<Instant>& series, double at, bool by_displacement) {
    const auto place = [&](const Instant& row) { return by_displacement ? row.displacement : row.time; };
    const auto after = std::find_if(series.begin(), series.end(), [&](const Instant& row) { return place(row) >= at; });
    if (after == series.end()) return series.back();
    if (after == series.begin()) return series.front();
    const Instant& before = *std::prev(after);
    const double s = (at - place(before)) / (place(*after) - place(before));
    Instant instant = before;
    instant.time = std::lerp(before.time, after->time, s);
    instant.displacement = std::lerp(before.displacement, after->displacement, s);
    instant.crack_length = std::lerp(before.crack_length, after->crack_length, s);
    instant.tip = before.tip + s * (after->tip - before.tip);
    return instant;
}

Revisit::Revisit(const Scene& scene, const Plan& plan, const MaterialMap& materials, Quasistatic& walk)
    : walk_(walk), body_(scene, materials), equilibrium_(scene, plan, materials, body_), tracked_(tracked_tip(scene)) {}

void Revisit::grow(const Vec2& to, int crack, bool at_end) {
    const CrackTip& tip = equilibrium_.cracks().lines[crack].tip(at_end);
    if (tip.inside && (to - tip.position).norm() > 1e-6 * body_.layout.cell.minCoeff()) equilibrium_.grow(crack, at_end, to);
}

bool Revisit::to(const Instant& instant) {
    const double length = instant.crack_length * (1.0 + 1e-9);
    while (tracked_.crack >= 0 && !walk_.station(station_).left && walk_.reach(station_ + 1, instant.time) &&
           walk_.station(station_ + 1).lengths[tracked_.crack] <= length) {
        const Station& from = walk_.station(station_++);
        grow(walk_.station(station_).tips[from.crack][from.at_end], from.crack, from.at_end);
    }
    if (tracked_.crack >= 0) grow(instant.tip, tracked_.crack, tracked_.at_end);
    return equilibrium_.solve(instant.time) == Equilibrium::Outcome::solved;
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
        const Instant instant = instant_at(record.series, at, probes.by_displacement);
        if (!revisit.to(instant)) return;
        ProbeReading& reading = record.probes.emplace_back(read_probes(probes.places, revisit));
        if (wide && wide->revisit.to(instant))
            extrapolate(reading, read_probes(probes.places, wide->revisit), probes.places, wide->revisit.body().layout.cell.maxCoeff());
    }
}

} // namespace crampfit
