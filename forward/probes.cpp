#include "forward/probes.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace crampfit {

std::vector<std::vector<Vec2>> read_probes(const Probes& probes, const Discretisation& body, const CrackFields& cracks,
                                           const std::vector<const std::vector<Vec2>*>& displacements) {
    const Layout& layout = body.layout;
    std::vector<std::vector<Vec2>> readings(displacements.size());
    const std::size_t group = probes.weights.size();
    for (std::size_t i = 0; i < probes.places.size(); ++i) {
        const Vec2& place = probes.places[i];
        if (i % group == 0)
            for (auto& reading : readings) reading.push_back(Vec2::Zero());
        if (body.point_at(place) < 0) {
            for (auto& reading : readings) reading.back().setConstant(std::numeric_limits<double>::quiet_NaN());
            continue;
        }
        const int c = layout.cell_at(place);
        const auto weights = body.values_at(c, place);
        const auto fields = cracks.fields_at(c, place);
        for (std::size_t d = 0; d < displacements.size(); ++d)
            for (int k = 0; k < layout.nodes_per_cell(); ++k)
                readings[d].back() += probes.weights[i % group] * weights[k] * (*displacements[d])[fields[k]];
    }
    return readings;
}

ProbeReading read_probes(const Probes& probes, const Discretisation& body, const CrackFields& cracks,
                         const std::vector<Vec2>& displacement) {
    ProbeReading reading{read_probes(probes, body, cracks, {&displacement}).front(), {}};
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

}  // namespace

// How much of the way from the station to the next the cracks have gone.
double WayFinder::share_gone(const Record& record, const SeriesPlace& place) {
    if (walk_.station(station_).left || !walk_.reach(station_ + 1, time_at(record, place))) return 0.0;
    double least = 1.0;
    for (const auto& [crack, at_end, route] : walk_.station(station_).moving) {
        const double length =
            std::lerp(length_at(record, crack, place.row), length_at(record, crack, next_row(record, place)), place.share);
        const double here = walk_.station(station_).lengths[crack];
        const double grown = walk_.station(station_ + 1).lengths[crack] - here;
        if (length < here + grown) least = std::min(least, std::max(0.0, (length - here) / grown));
    }
    return least > 1.0 - 1e-9 ? 1.0 : least;
}

void WayFinder::to(const Record& record, const SeriesPlace& place) {
    while ((share_ = share_gone(record, place)) == 1.0) ++station_;
}

Revisit::Revisit(const Scene& scene, const Plan& plan, const MaterialMap& materials, const Discretisation& body,
                 Quasistatic& walk)
    : walk_(walk), finder_(walk), body_(body), equilibrium_(scene, plan, materials, body_) {}

// Moves the tips that move on from the station by this share of the way to the next.
void Revisit::grow(double share) {
    for (const auto& [crack, at_end, route] : walk_.station(station_).moving) {
        const Vec2& start = walk_.station(station_).tips[crack][at_end];
        const Vec2 to = start + share * (walk_.station(station_ + 1).tips[crack][at_end] - start);
        const CrackTip& tip = equilibrium_.cracks().lines[crack].tip(at_end);
        if (tip.inside && (to - tip.position).norm() > 1e-6 * body_.layout.cell.minCoeff()) equilibrium_.grow(crack, at_end, to);
    }
}

bool Revisit::to(const Record& record, const SeriesPlace& place) {
    finder_.to(record, place);
    for (; station_ < finder_.station(); ++station_) grow(1.0);
    if (finder_.share() > 0.0) grow(finder_.share());
    return equilibrium_.solve(time_at(record, place)) == Equilibrium::Outcome::solved;
}

void read_probes(const Scene& scene, Quasistatic& walk, Record& record) {
    const Probes& probes = scene.output.probes;
    if (probes.places.empty()) return;
    WayFinder finder(walk);
    std::vector<std::vector<Vec2>> cracks;  // up to the station
    for (const Crack& crack : scene.cracks) cracks.push_back(crack.points);
    const auto add = [](std::vector<std::vector<Vec2>>& lines, const std::vector<std::array<Vec2, 2>>& tips) {
        for (std::size_t k = 0; k < lines.size(); ++k) {
            if (tips[k][1] != lines[k].back()) lines[k].push_back(tips[k][1]);
            if (tips[k][0] != lines[k].front()) lines[k].insert(lines[k].begin(), tips[k][0]);
        }
    };
    std::size_t reached = 0;
    for (const double at : probes.instants) {
        const SeriesPlace place = place_in(record.series, at, probes.by_displacement);
        const double time = time_at(record, place);
        finder.to(record, place);
        for (; reached < finder.station(); ++reached) add(cracks, walk.station(reached + 1).tips);
        ProbeReading reading{walk.probes_at(reached, time), cracks};
        if (const double share = finder.share(); share > 0.0) {
            const std::vector<Vec2> next = walk.probes_at(reached + 1, time);
            if (next.empty()) return;
            for (std::size_t i = 0; i < reading.moved.size(); ++i) reading.moved[i] += share * (next[i] - reading.moved[i]);
            std::vector<std::array<Vec2, 2>> tips = walk.station(reached).tips;
            for (std::size_t k = 0; k < tips.size(); ++k)
                for (int end = 0; end < 2; ++end) tips[k][end] += share * (walk.station(reached + 1).tips[k][end] - tips[k][end]);
            add(reading.cracks, tips);
        }
        if (reading.moved.empty()) return;
        record.probes.push_back(std::move(reading));
    }
}

}  // namespace crampfit
