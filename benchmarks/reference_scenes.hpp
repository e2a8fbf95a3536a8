#pragma once

#include "forward/deformation.hpp"

#include <cmath>
#include <complex>
#include <numbers>

/// Scenes whose answers are known, for `crampfit bench` and for the tests.
namespace crampfit::reference {

constexpr double degree = std::numbers::pi / 180.0;

/// E' of the earlywood of `block` in plane strain [Pa].
inline double plane_modulus() { return 40e6 / (1 - 0.33 * 0.33); }

inline Edge moving(std::string name, Side side, Vec2 velocity) {
    Edge edge;
    edge.name = std::move(name);
    edge.side = side;
    edge.velocity = {velocity.x(), velocity.y()};
    return edge;
}

inline Edge pulled(std::string name, Side side, Vec2 traction) {
    Edge edge;
    edge.name = std::move(name);
    edge.side = side;
    edge.traction = traction;
    return edge;
}

/// A component that an edge leaves free.
inline Edge without(Edge edge, int axis) {
    edge.velocity[axis].reset();
    return edge;
}

/// A rectangle of earlywood, 1 m thick, that nothing loads yet.
inline Scene block(Vec2 size, double cell) {
    Scene scene;
    scene.model = {PlaneCondition::strain, 1.0, cell, 4};
    scene.specimen.size = size;
    scene.specimen.material = "EW";
    scene.materials["EW"] = {40e6, 0.33, 300.0, 100.0};  // E, nu, density, toughness
    scene.file = "test.toml";
    return scene;
}

/// The same at equilibrium, with its whole load after a second.
inline Scene at_rest(Vec2 size, double cell) {
    Scene scene = block(size, cell);
    scene.solver.kind = SolverKind::quasistatic;
    scene.stop.time = 1.0;
    return scene;
}

/// Holds, or moves in a second, what lies within a quarter of a cell of a place on a side; an absent component is free [m].
inline Edge held_at(std::string name, Side side, double place, double cell, std::optional<double> x, std::optional<double> y) {
    Edge edge;
    edge.name = std::move(name);
    edge.side = side;
    edge.range = {{place - 0.25 * cell, place + 0.25 * cell}};
    edge.velocity = {x, y};
    return edge;
}

/// Stress around a crack from -a to a on the x axis of an infinite plate under remote stress (Westergaard 1939, with Irwin's
/// T-stress; Z = z / (z^2 - a^2)^1/2) [Pa].
inline Mat2 griffith_stress(const Mat2& remote, double a, const Vec2& x) {
    using Complex = std::complex<double>;
    const Complex z(x.x(), x.y());
    const Complex root = std::sqrt(z - a) * std::sqrt(z + a);
    const Complex Z = z / root;
    const Complex dZ = -a * a / (root * root * root);
    const double y = x.y(), s = remote(1, 1), t = remote(0, 1);
    const double xx = s * (Z.real() - y * dZ.imag()) + remote(0, 0) - s + t * (2.0 * Z.imag() + y * dZ.real());
    const double yy = s * (Z.real() + y * dZ.imag()) - t * y * dZ.real();
    const double xy = -s * y * dZ.real() + t * (Z.real() - y * dZ.imag());
    Mat2 stress;
    stress << xx, xy, xy, yy;
    return stress;
}

/// Puts on all four sides of a square what the stress of a solution says, facet by facet, and holds the square so that what holds
/// it feels nothing: the load is in balance.
template <class Stress>
void load_sides(Scene& scene, Stress stress) {
    const double width = scene.specimen.size.x(), h = scene.model.cell;
    const int facets = static_cast<int>(std::lround(std::sqrt(scene.model.points_per_cell) * width / h));  // points along a side
    for (const Side side : {Side::top, Side::bottom, Side::left, Side::right}) {
        for (int i = 0; i < facets; ++i) {
            const double from = i * width / facets, to = (i + 1) * width / facets, middle = 0.5 * (from + to);
            const bool level = side == Side::top || side == Side::bottom;
            const double far = side == Side::top || side == Side::right ? 1.0 : -1.0;
            const double fixed = far > 0 ? width : 0.0;
            const Vec2 x = level ? Vec2(middle, fixed) : Vec2(fixed, middle);
            const Vec2 normal = level ? Vec2(0.0, far) : Vec2(far, 0.0);
            Edge edge = pulled("side", side, stress(x) * normal);
            edge.range = {{from, to}};
            scene.edges.push_back(edge);
        }
    }
    scene.edges.push_back(held_at("hinge", Side::left, 0.5 * width, h, 0.0, 0.0));
    scene.edges.push_back(held_at("slide", Side::right, 0.5 * width, h, std::nullopt, 0.0));
    scene.measure = {"hinge", "hinge"};
}

/// 4 x 4 mm, E 40 MPa left of a sharp boundary and 1200 MPa right of it, pulled apart by 0.02 mm in a second; a crack that grows
/// at half height from the left, its tip at `tip` [m].
inline Scene two_woods(double boundary, double tip, double cell) {
    Scene scene = at_rest({4e-3, 4e-3}, cell);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-1000.0 + boundary, 2e-3), 2000.0, 0.5, 0.0};
    scene.materials["LW"] = scene.materials["EW"];
    scene.materials["LW"].youngs_modulus = 1200e6;
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, -1e-5})};
    Crack crack;
    crack.points = {Vec2(0.0, 2e-3), Vec2(tip, 2e-3)};
    crack.grows = Growth::end;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    return scene;
}

struct SlantedCrack {
    double cells = 10.0;         // per half crack
    double angle = 0.0;          // of the crack against the grid [rad]
    Mat2 remote = Mat2::Zero();  // stress far away [Pa]
    Vec2 offset = Vec2::Zero();  // of the crack's centre from a node, in cells
    double half_length = 10e-3;  // a [m]
    int points_per_cell = 4;
};

/// A square of half width 3 a cut out of the infinite plate with a centre crack: its sides carry the exact stress there, so that
/// K is exactly that of the infinite plate. `exact` is that of the wood, by default isotropic: remote stress, half length, place,
/// all in the crack's axes.
template <class Exact = decltype(griffith_stress)>
Scene slanted_crack(const SlantedCrack& c, const Exact& exact = griffith_stress) {
    const double a = c.half_length;
    const double h = a / c.cells;
    const double width = 6.0 * a;
    Scene scene = at_rest({width, width}, h);
    scene.model.points_per_cell = c.points_per_cell;
    const Vec2 centre = Vec2(0.5 * width, 0.5 * width) + h * c.offset;
    const Vec2 along(std::cos(c.angle), std::sin(c.angle));
    Mat2 axes;
    axes << along, left_of(along);
    const Mat2 remote = axes.transpose() * c.remote * axes;
    load_sides(scene, [&](const Vec2& x) -> Mat2 {
        return axes * exact(remote, a, axes.transpose() * (x - centre)) * axes.transpose();
    });
    Crack crack;
    crack.points = {centre - a * along, centre + a * along};
    scene.cracks = {crack};
    return scene;
}

}  // namespace crampfit::reference
