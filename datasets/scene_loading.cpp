#include "datasets/scene_geometry.hpp"
#include "datasets/scene_parts.hpp"

#include <fmt/format.h>

#include <limits>

namespace crampfit {
namespace {

/// A word, or the table { friction = 0.3 }: how two surfaces meet.
template <class Meeting>
Meeting read_meeting(const Entry& entry, const Choices<typename Meeting::Kind>& words) {
    Meeting meeting;
    if (entry.is_table()) {
        entry.only({"friction"});
        meeting.kind = Meeting::Kind::friction;
        meeting.coefficient = entry.at("friction").number(limits::friction);
    } else {
        meeting.kind = entry.choice(words, "{ friction = 0.3 }");
    }
    return meeting;
}

bool is_free(const Entry& component) { return component.is_text() && component.text() == "free"; }

std::vector<Entry> velocity_components(const Entry& velocity) {
    return velocity.list(2, "two velocities, such as [\"0 m/s\", \"1 mm/min\"]");
}

std::pair<double, double> read_range(const Entry& entry, double side_length) {
    const std::vector<Entry> ends = entry.list(2, "two lengths, such as [\"4 mm\", \"6 mm\"]");
    const double low = ends[0].number(limits::coordinate);
    const double high = ends[1].number(limits::coordinate);
    if (!(low < high)) {
        entry.fail("the range is reversed or empty: write the lower end first");
    }
    constexpr double rounding = 1e-12;  // of decimals
    if (low < 0 || high > side_length * (1 + rounding)) {
        entry.fail(fmt::format("the range must lie on the side, from 0 to {:g} mm", 1e3 * side_length));
    }
    return {low, high};
}

Edge read_edge(const Entry& entry, const Vec2& specimen_size) {
    entry.only({"name", "side", "range", "velocity", "traction", "until"});
    Edge edge;
    const Entry side = entry.at("side");
    edge.side = side.choice<Side>({{"top", Side::top}, {"bottom", Side::bottom}, {"left", Side::left}, {"right", Side::right}});
    const auto name = entry.find("name");
    edge.name = name ? name->text() : side.text();
    if (const auto range = entry.find("range")) {
        const bool along_x = edge.side == Side::top || edge.side == Side::bottom;
        edge.range = read_range(*range, along_x ? specimen_size.x() : specimen_size.y());
    }
    if (entry.has("velocity") == entry.has("traction")) {
        entry.fail("give one of velocity and traction");
    }
    if (const auto traction = entry.find("traction")) {
        const std::vector<Entry> components = traction->list(2, "two pressures, such as [\"0 MPa\", \"1 MPa\"]");
        edge.traction = Vec2(components[0].number(limits::traction), components[1].number(limits::traction));
    } else {
        const std::vector<Entry> components = velocity_components(entry.at("velocity"));
        for (std::size_t axis = 0; axis < 2; ++axis) {
            if (!is_free(components[axis])) {
                edge.velocity[axis] = components[axis].number(limits::velocity);
            }
        }
    }
    if (const auto until = entry.find("until")) {
        if (edge.traction) {
            until->fail("belongs to a velocity: an edge with a traction has none");
        }
        edge.until = until->number(limits::until);
    }
    return edge;
}

/// Each component of a body's motion is either prescribed or free to follow a force.
void read_motion(const Entry& entry, Body& body) {
    const Entry velocity = entry.at("velocity");
    const std::vector<Entry> components = velocity_components(velocity);
    for (std::size_t axis = 0; axis < 2; ++axis) {
        body.free[axis] = is_free(components[axis]);
        if (!body.free[axis]) {
            body.velocity[static_cast<Eigen::Index>(axis)] = components[axis].number(limits::velocity);
        }
    }
    const auto force = entry.find("force");
    if (!force) {
        if (body.free[0] || body.free[1]) {
            velocity.fail("a free component follows a force: give force = [\"0 N\", ...]");
        }
        return;
    }
    const std::vector<Entry> forces = force->list(2, "two forces, such as [\"0 N\", \"-3 N\"]");
    for (std::size_t axis = 0; axis < 2; ++axis) {
        const double value = forces[axis].number(limits::force);
        if (!body.free[axis] && value != 0.0) {
            forces[axis].fail("the velocity prescribes this component: make it \"free\" to let it follow a force");
        }
        body.force[static_cast<Eigen::Index>(axis)] = value;
    }
}

Body read_body(const Entry& entry, std::size_t number) {
    entry.only({"name", "circle", "polygon", "contact", "velocity", "force", "until"});
    Body body;
    const auto name = entry.find("name");
    body.name = name ? name->text() : fmt::format("body {}", number);
    body.shape = read_shape(entry);
    if (const auto contact = entry.find("contact")) {
        body.contact =
            read_meeting<Contact>(*contact, {{"frictionless", Contact::Kind::frictionless}, {"bonded", Contact::Kind::bonded}});
    }
    read_motion(entry, body);
    if (const auto until = entry.find("until")) {
        body.until = until->number(limits::until);
    }
    return body;
}

std::vector<Vec2> read_crack_points(const Entry& entry, const Vec2& specimen_size) {
    std::vector<Vec2> points;
    for (const Entry& point : entry.list()) {
        points.push_back(point.point());
    }
    if (points.size() < 2) {
        entry.fail("a crack has at least 2 points");
    }
    if (const std::size_t i = repeated_point(points, false); i < points.size()) {
        entry.fail(fmt::format("point {} repeats the one before it: a segment of the crack has no length", i));
    }
    if (crosses_itself(points, false)) {
        entry.fail("a crack must not cross or touch itself");
    }
    if (!meets_rectangle(points, specimen_size)) {
        entry.fail("the crack lies outside the specimen, or only along its sides");
    }
    return points;
}

Bridging read_bridging(const Entry& entry) {
    entry.only({"stress", "opening", "on"});
    Bridging bridging{entry.at("stress").number(limits::bridging_stress), entry.at("opening").number(limits::bridging_opening)};
    if (const auto on = entry.find("on")) {
        bridging.on_all_faces = on->choice<bool>({{"new faces", false}, {"all faces", true}});
    }
    return bridging;
}

CrackFaces read_faces(const Entry& entry) {
    if (entry.is_table()) {
        entry.only({"friction", "traction"});
    }
    if (!entry.is_table() || !entry.has("traction")) {
        return read_meeting<CrackFaces>(entry,
                                        {{"frictionless", CrackFaces::Kind::frictionless}, {"stick", CrackFaces::Kind::stick}});
    }
    if (entry.has("friction")) {
        entry.fail("give one of friction and traction: faces that a traction pulls together do not rub");
    }
    CrackFaces faces;
    faces.bridging = read_bridging(entry.at("traction"));
    return faces;
}

Crack read_crack(const Entry& entry, const Vec2& specimen_size) {
    entry.only({"points", "grows", "criterion", "advance", "direction", "faces"});
    Crack crack;
    crack.points = read_crack_points(entry.at("points"), specimen_size);
    if (const auto grows = entry.find("grows")) {
        crack.grows = grows->choice<Growth>(
            {{"none", Growth::none}, {"start", Growth::start}, {"end", Growth::end}, {"both", Growth::both}});
    }
    if (const auto criterion = entry.find("criterion")) {
        criterion->choice<bool>({{"energy release rate", true}});
    }
    if (const auto advance = entry.find("advance")) {
        crack.advance = advance->number(limits::advance);
    }
    if (const auto direction = entry.find("direction")) {
        crack.direction = direction->choice<GrowthDirection>({{"normal to opening", GrowthDirection::normal_to_opening},
                                                              {"hoop stress", GrowthDirection::hoop_stress},
                                                              {"energy release rate", GrowthDirection::energy_release_rate},
                                                              {"straight", GrowthDirection::straight}});
    }
    if (const auto faces = entry.find("faces")) {
        crack.faces = read_faces(*faces);
        if (crack.faces.bridging && !crack.faces.bridging->on_all_faces && crack.grows == Growth::none) {
            faces->at("traction")
                .fail("acts where the crack grows, and this one does not: give on = \"all faces\", or let it grow");
        }
    }
    return crack;
}

}  // namespace

// Two edges may meet at a place, and share a stretch that they move alike.
void check_agrees(const Edge& edge, const Entry& entry, const std::vector<Edge>& before) {
    const auto stretch = [](const Edge& e) { return e.range.value_or(std::pair{0.0, std::numeric_limits<double>::infinity()}); };
    for (const Edge& other : before) {
        const auto [low, high] = stretch(edge);
        const auto [other_low, other_high] = stretch(other);
        if (other.side != edge.side || std::min(high, other_high) <= std::max(low, other_low)) {
            continue;
        }
        for (const std::size_t axis : {0u, 1u}) {
            const auto &here = edge.velocity[axis], &there = other.velocity[axis];
            if (here && there && (*here != *there || (*here != 0.0 && edge.until != other.until))) {
                entry.fail(
                    fmt::format("moves its {} otherwise than edge \"{}\", which holds a stretch of it too: give each its own "
                                "range",
                                axis == 0 ? "x" : "y", other.name));
            }
        }
    }
}

std::vector<Edge> read_edges(const Entry& edges, const Vec2& specimen_size) {
    std::vector<Edge> result;
    for (const Entry& edge : edges.list()) {
        const Edge read = read_edge(edge, specimen_size);
        check_agrees(read, edge, result);
        result.push_back(read);
    }
    return result;
}

std::vector<Body> read_bodies(const Entry& bodies) {
    std::vector<Body> result;
    for (const Entry& body : bodies.list()) {
        result.push_back(read_body(body, result.size()));
    }
    return result;
}

std::vector<Crack> read_cracks(const Entry& cracks, const Vec2& specimen_size) {
    std::vector<Crack> result;
    for (const Entry& crack : cracks.list()) {
        result.push_back(read_crack(crack, specimen_size));
        for (std::size_t k = 0; k + 1 < result.size(); ++k) {
            if (share_a_stretch(result[k].points, result.back().points)) {
                crack.at("points").fail(fmt::format("lies on cracks.{} for a stretch: cracks may cross or touch, no more", k));
            }
        }
    }
    return result;
}

}  // namespace crampfit
