#include "forward/loading.hpp"

#include <algorithm>
#include <cmath>
#include <set>

namespace crampfit {

namespace {

constexpr double infinity = std::numeric_limits<double>::infinity();

double speed_of(const Edge& edge) { return std::hypot(edge.velocity[0].value_or(0.0), edge.velocity[1].value_or(0.0)); }
double speed_of(const Body& body) { return body.velocity.norm(); }

// Calls visit(driver) for each edge and body.
template <class Visit>
void for_drivers(const Scene& scene, const Visit& visit) {
    std::for_each(scene.edges.begin(), scene.edges.end(), visit);
    std::for_each(scene.bodies.begin(), scene.bodies.end(), visit);
}

}  // namespace

std::optional<Drive> measured_drive(const Scene& scene) {
    std::optional<Drive> drive;
    for_drivers(scene, [&](const auto& driver) {
        if (driver.name == scene.measure.displacement && speed_of(driver) > 0.0)
            drive = Drive{speed_of(driver), driver.until.value_or(infinity)};
    });
    return drive;
}

double end_time(const Scene& scene) {
    const double end = scene.stop.time.value_or(infinity);
    const std::optional<Drive> drive = measured_drive(scene);
    if (!drive || !scene.stop.displacement || !drive->comes_to(*scene.stop.displacement)) return end;
    return std::min(end, *scene.stop.displacement / drive->speed);
}

bool may_end(const Scene& scene) {
    if (std::isfinite(end_time(scene))) return true;
    const bool is_loaded = farthest_motion(scene, infinity) > 0.0 || has_dead_load(scene);
    const auto measured = [&](const auto& driver) { return driver.name == scene.measure.displacement; };
    const bool follows =
        std::ranges::any_of(scene.edges, [&](const Edge& edge) { return measured(edge) && edge.traction; }) ||
        std::ranges::any_of(scene.bodies, [&](const Body& body) { return measured(body) && (body.free[0] || body.free[1]); });
    const bool grows = std::ranges::any_of(scene.cracks, [](const Crack& crack) { return crack.grows != Growth::none; });
    return (follows && scene.stop.displacement) || (grows && is_loaded && scene.stop.crack_length);
}

double farthest_motion(const Scene& scene, double end) {
    double farthest = 0.0;
    for_drivers(scene, [&](const auto& driver) {
        if (speed_of(driver) > 0.0) farthest = std::max(farthest, speed_of(driver) * std::min(end, driver.until.value_or(end)));
    });
    for (const Part& part : scene.specimen.parts)
        if (!part.velocity.isZero(0.0)) farthest = std::max(farthest, part.velocity.norm() * end);
    return farthest;
}

double splitting_motion(const Scene& scene, const Discretisation& body) {
    double toughest = 0.0;
    double softest = infinity;
    for (const auto& [name, wood] : scene.materials) toughest = std::max(toughest, wood.toughness);
    for (int p = 0; p < body.points.count(); ++p) softest = std::min(softest, body.points.stiffest(p));
    const double half_height = 0.5 * scene.specimen.size.minCoeff();
    return 1.5 * 2.0 * half_height * std::sqrt(toughest / (softest * half_height));
}

Travel travel_of(const Scene& scene) {
    Travel travel;
    double last = 0.0;
    std::set<double> ends;
    for_drivers(scene, [&](const auto& driver) {
        if (speed_of(driver) == 0.0) return;
        travel.fastest = std::max(travel.fastest, speed_of(driver));
        const double until = driver.until.value_or(infinity);
        ends.insert(until);
        last = std::max(last, until);
    });
    if (travel.fastest > 0.0) travel.until = last;
    ends.erase(last);
    travel.stops.assign(ends.begin(), ends.end());
    return travel;
}

bool slides_along(const Scene& scene, int axis) {
    const auto slides = [](const Body& body) { return body.contact.kind == Contact::Kind::frictionless; };
    const auto holds = [axis](const Edge& edge) { return edge.velocity[axis].has_value(); };
    return std::ranges::all_of(scene.bodies, slides) && std::ranges::none_of(scene.edges, holds);
}

std::string advice_on_holds(const Scene& scene) {
    return slides_along(scene, 0) || slides_along(scene, 1)
               ? "; along one axis frictionless bodies alone hold the specimen: hold it at an edge, or give one of them friction"
               : "";
}

bool has_dead_load(const Scene& scene) {
    return std::ranges::any_of(scene.edges, [](const Edge& edge) { return edge.traction.has_value(); }) ||
           std::ranges::any_of(scene.bodies, [](const Body& rigid) { return !rigid.force.isZero(0.0); });
}

}  // namespace crampfit
