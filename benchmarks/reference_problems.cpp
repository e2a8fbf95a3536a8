#include "benchmarks/reference_problems.hpp"

#include "benchmarks/reference_scenes.hpp"

namespace crampfit::reference {

namespace {

constexpr double stress = 1e5;        // remote [Pa]
constexpr double wave_speed = 365.0;  // of a bar of earlywood [m/s]

Scene with_points(Scene scene, int points_per_cell) {
    scene.model.points_per_cell = points_per_cell;
    return scene;
}

// The first mode of a bar that is held at one end; what a crack leaves is softer.
double slowest_of_block(double size) { return std::numbers::pi * wave_speed / (2.0 * size); }

// ---- an infinite plate with a crack (Griffith 1921; Westergaard 1939): a square cut out of it

Problem griffith(const std::string& name, double slant, const std::string& quantity,
                 std::function<double(const Instant&)> ratio) {
    const SlantedCrack plate;
    return {name,
            quantity,
            "Westergaard 1939",
            0.0,
            "half crack",
            {5, 10, 20, 40},
            0.5 * slowest_of_block(6.0 * plate.half_length),
            [slant](double cells, int points_per_cell) {
                SlantedCrack crack;
                crack.cells = cells;
                crack.angle = slant;
                crack.points_per_cell = points_per_cell;
                crack.offset = {0.13, 0.27};
                crack.remote(1, 1) = stress;
                return slanted_crack(crack);
            },
            [ratio](const Record& record) { return ratio(record.series.back()); }};
}

double griffith_K() { return stress * std::sqrt(std::numbers::pi * SlantedCrack{}.half_length); }

// ---- a strip between grips, 60 x 10 mm, a crack of 20 mm

constexpr double strip_pull = 1e-5;  // [m]
constexpr double strip_height = 10e-3;

double constrained_modulus() { return 40e6 * (1 - 0.33) / ((1 + 0.33) * (1 - 2 * 0.33)); }

Scene strip(double cells, int points_per_cell) {
    Scene scene = with_points(at_rest({60e-3, strip_height}, 0.5 * strip_height / cells), points_per_cell);
    scene.edges = {moving("top", Side::top, {0.0, strip_pull}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(0.0, 0.5 * strip_height), Vec2(20e-3, 0.5 * strip_height)};  // ends are far off
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    return scene;
}

double strip_G() { return 0.5 * strip_pull * strip_pull * constrained_modulus() / strip_height; }

Scene growing_strip(double cells, int points_per_cell) {
    Scene scene = strip(cells, points_per_cell);
    scene.cracks[0].grows = Growth::end;
    scene.cracks[0].direction = GrowthDirection::straight;
    scene.cracks[0].advance = 2.0 * scene.model.cell;
    scene.materials["EW"].toughness = 0.25 * strip_G();  // it runs at half the pull
    scene.stop.crack_length = 21e-3;
    return scene;
}

// ---- a crack that comes to stiffer wood: what its next 0.2 mm, up to the boundary, release is least

constexpr double way_to_boundary = 0.2e-3;
// By finite elements, good to 2e-4: tests/forward/boundary_reference.py [J/m^2].
constexpr double rate_up_to_boundary = 1.6550;

Scene to_stiffer_wood(double cells, int points_per_cell) {
    constexpr double boundary = 2.025e-3;
    Scene scene = with_points(two_woods(boundary, boundary - way_to_boundary, way_to_boundary / cells), points_per_cell);
    scene.cracks[0].direction = GrowthDirection::straight;
    scene.cracks[0].advance = way_to_boundary;
    for (auto& [name, wood] : scene.materials) wood.toughness = 0.25 * rate_up_to_boundary;  // it runs at half the pull
    scene.stop.crack_length = boundary;
    return scene;
}

// Of a scene that runs at half of this pull.
std::function<double(const Record&)> at_growth(double pull) {
    return [pull](const Record& record) {
        return record.driving.empty() ? std::nan("") : record.driving.front().displacement / (0.5 * pull);
    };
}

}  // namespace

Scene edge_crack(double cells, double share, int points_per_cell) {
    const double a = 10e-3, h = a / cells, W = a / share, H = 3 * W;
    Scene scene = with_points(at_rest({W, H}, h), points_per_cell);
    // Two neighbours on the far side hold it: the load is in balance, they feel nothing.
    scene.edges = {pulled("top", Side::top, {0.0, stress}), pulled("bottom", Side::bottom, {0.0, -stress}),
                   held_at("hinge", Side::right, 0.5 * H, h, 0.0, 0.0),
                   held_at("slide", Side::right, 0.5 * H - h, h, 0.0, std::nullopt)};
    Crack crack;
    crack.points = {Vec2(0.0, 0.5 * H), Vec2(a, 0.5 * H)};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    return scene;
}

double edge_crack_K(double share) {
    const double angle = 0.5 * std::numbers::pi * share;
    const double F =
        std::sqrt(std::tan(angle) / angle) / std::cos(angle) * (0.752 + 2.02 * share + 0.37 * std::pow(1 - std::sin(angle), 3));
    return stress * std::sqrt(std::numbers::pi * 10e-3) * F;
}

Scene double_cantilever(double cells, int points_per_cell) {
    const double arm = 12e-3, h = arm / cells, P = 0.4;
    Scene scene = with_points(at_rest({100e-3, 2 * arm}, h), points_per_cell);
    scene.materials["EW"] = {1e5, 0.33, 300.0, 100.0};
    scene.edges = {pulled("up", Side::top, {0.0, P / 1e-3}), pulled("down", Side::bottom, {0.0, -P / 1e-3}),
                   held_at("hinge", Side::left, arm, h, 0.0, 0.0), held_at("slide", Side::left, arm + h, h, 0.0, std::nullopt)};
    scene.edges[0].range = scene.edges[1].range = {{99e-3, 100e-3}};
    Crack crack;
    crack.points = {Vec2(100e-3, arm), Vec2(51e-3, arm)};
    scene.cracks = {crack};
    scene.measure = {"up", "up"};
    return scene;
}

double double_cantilever_G() {
    const double P = 0.4, arm = 12e-3, a = 48.5e-3, E = 1e5 / (1 - 0.33 * 0.33);
    return 12 * P * P * a * a / (E * arm * arm * arm) * std::pow(1 + 0.677 * arm / a, 2);
}

std::vector<Problem> problems() {
    const double arm_speed = std::sqrt(1e5 / 300.0) * 12e-3 / std::sqrt(12.0);  // of bending, (E I / rho A)^1/2 [m^2/s]
    return {
        griffith("centre crack", 0.0, "G",
                 [](const Instant& end) { return end.G * plane_modulus() / (griffith_K() * griffith_K()); }),
        griffith("slanted crack at 30 deg", 30 * degree, "K_II",
                 [](const Instant& end) { return end.K_II / (griffith_K() * std::sin(30 * degree) * std::cos(30 * degree)); }),
        {"edge crack",
         "K_I",
         "Tada, Paris and Irwin 2000",
         0.005,
         "crack",
         {5, 10, 20, 40},
         0.2 * slowest_of_block(60e-3),
         [](double cells, int points) { return edge_crack(cells, 0.5, points); },
         [](const Record& record) { return record.series.back().K_I / edge_crack_K(0.5); }},
        {"double cantilever beam",
         "G",
         "Kanninen 1973",
         0.01,
         "arm height",
         {6, 12, 24},
         3.52 * arm_speed / (48.5e-3 * 48.5e-3),
         double_cantilever,
         [](const Record& record) { return record.series.back().G / double_cantilever_G(); }},
        {"strip",
         "G",
         "Rice 1968",
         0.0,
         "half height",
         {5, 10, 20},
         slowest_of_block(60e-3),
         strip,
         [](const Record& record) { return record.series.back().G / strip_G(); }},
        {"strip",
         "displacement at growth",
         "Rice 1968",
         0.0,
         "half height",
         {5, 10, 20},
         0.0,
         growing_strip,
         at_growth(strip_pull)},
        {"wood 30 times as stiff ahead",
         "displacement at growth",
         "finite elements",
         1e-4,
         "advance",
         {1, 2, 4},
         0.0,
         to_stiffer_wood,
         at_growth(1e-5)},
    };
}

Scene in_damped_motion(Scene scene, double slowest) {
    const double period = 2.0 * std::numbers::pi / slowest;
    for (Edge& edge : scene.edges) {
        if (edge.traction) continue;
        for (auto& v : edge.velocity)
            if (v) *v /= period;
        edge.until = period;
    }
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.solver.damping = 2.0 * slowest;
    scene.stop.time = period + 12.0 / slowest;  // (1 + x) exp(-x) is 8e-5 at x = 12
    return scene;
}

}  // namespace crampfit::reference
