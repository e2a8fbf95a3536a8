// Coulomb friction of bodies and of crack faces, and bodies that follow a force, against statics and exact solutions.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>

namespace crampfit::test {
namespace {

Polygon rectangle(const Vec2& low, const Vec2& high) { return {{low, {high.x(), low.y()}, high, {low.x(), high.y()}}}; }

Body rough(std::string name, Shape shape, Vec2 velocity, double friction) {
    Body body;
    body.name = std::move(name);
    body.shape = std::move(shape);
    body.velocity = velocity;
    body.contact = {friction > 0.0 ? Contact::Kind::friction : Contact::Kind::frictionless, friction};
    return body;
}

Vec2 push_of(const StaticTrial& run, int body) { return run.equilibrium.reactions()[run.equilibrium.boundary().first_body() + body]; }

// A block hangs from its top; a plate presses on its lower side with a force and goes aside by 1 mm a second, or follows a force.
Scene on_a_plate(double friction, double push) {
    Scene scene = at_rest({10e-3, 5e-3}, 0.5e-3);
    scene.edges = {moving("top", Side::top, {0.0, 0.0})};
    scene.bodies = {rough("plate", rectangle({-5e-3, -2e-3}, {15e-3, 0.0}), {1e-3, 0.0}, friction)};
    scene.bodies[0].free = {false, true};
    scene.bodies[0].force = {0.0, push};
    scene.measure = {"plate", "plate"};
    return scene;
}

TEST(VerificationFriction, APlateDragsByTheCoefficientTimesItsForce) {
    for (const double friction : {0.1, 0.3, 0.8}) {
        StaticTrial run(on_a_plate(friction, 1e3));
        double before = 0.0;
        for (int k = 0; k <= 10; ++k) {
            ASSERT_TRUE(run.solve(0.1 * k)) << friction << " " << k;
            const Vec2 push = push_of(run, 0);
            std::printf("friction %.1f, gone %.1f mm: drag over push %.7f, %d factorisations\n", friction, 0.1 * k, push.x() / push.y(), run.equilibrium.factorisations());
            EXPECT_NEAR(push.y(), 1e3, 1e-3);
            EXPECT_LE(push.x(), friction * push.y() * (1 + 1e-6));
            EXPECT_GE(push.x(), before - 1e-3);
            before = push.x();
        }
        EXPECT_NEAR(before, friction * 1e3, 1e-6 * friction * 1e3);
    }
}

TEST(VerificationFriction, OnASlopeItSticksUpToTheFrictionAngle) {
    // The force leans by an angle: below atan(friction) nothing slides away, above nothing holds.
    const double friction = 0.4;
    for (const double share : {0.5, 0.9, 0.99, 1.01, 1.2}) {
        Scene scene = on_a_plate(friction, 1e3);
        scene.bodies[0].velocity.setZero();
        scene.bodies[0].free = {true, true};
        scene.bodies[0].force.x() = share * friction * 1e3;
        StaticTrial run(scene);
        const bool holds = run.solve(0.0);
        std::printf("slope of %.2f of the friction: %s\n", share, holds ? "holds" : "slides");
        EXPECT_EQ(holds, share < 1.0) << share;
        if (holds) {
            EXPECT_NEAR(push_of(run, 0).x(), share * friction * 1e3, 1e-3);
        }
    }
}

Scene hertz(double friction, double nu, double cell, double size) {
    const double R = 2e-3;
    Scene scene = at_rest({2 * size, size}, cell);
    scene.materials["EW"].poisson_ratio = nu;
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.bodies = {rough("wheel", Circle{Vec2(size, size + R), R}, {0.0, -1e-3}, friction)};
    scene.measure = {"wheel", "wheel"};
    return scene;
}

TEST(VerificationFreeBody, AForceGivesTheWayThatGaveTheForce) {
    for (const double friction : {0.0, 0.3}) {
        Scene driven = hertz(friction, 0.33, 0.1e-3, 3e-3);
        StaticTrial by_way(driven, false);
        ASSERT_TRUE(by_way.solve(0.05));
        Scene loaded = driven;
        loaded.bodies[0].velocity.setZero();
        loaded.bodies[0].free = {false, true};
        loaded.bodies[0].force = {0.0, push_of(by_way, 0).y()};
        StaticTrial by_force(loaded, false);
        ASSERT_TRUE(by_force.solve(0.0));
        const double way = by_force.equilibrium.contacts().moved[1].y();
        std::printf("friction %.1f: force %.4f N, way %.8f mm of -0.05 mm, %d and %d factorisations\n", friction, push_of(by_way, 0).y(), 1e3 * way,
                    by_way.equilibrium.factorisations(), by_force.equilibrium.factorisations());
        EXPECT_NEAR(push_of(by_force, 0).y(), push_of(by_way, 0).y(), 1e-6 * std::abs(push_of(by_way, 0).y()));
        EXPECT_NEAR(way, -0.05e-3, (friction > 0 ? 1e-3 : 1e-6) * 0.05e-3);
    }
}

TEST(VerificationFriction, CattaneoMindlin) {
    const double nu = 0.45, size = 2.4e-3, cell = 0.03e-3, friction = 0.3, P = 1e3, R = 2e-3;
    Scene scene = hertz(friction, nu, cell, size);
    scene.bodies[0].velocity = {1e-3, 0.0};
    scene.bodies[0].free = {false, true};
    scene.bodies[0].force = {0.0, -P};
    StaticTrial run(scene, false);
    const double a = std::sqrt(4 * P * R * (1 - nu * nu) / (std::numbers::pi * 40e6));
    int before = 0;
    for (int k = 0; k <= 12; ++k) {
        ASSERT_TRUE(run.solve(0.004 * k)) << k;
        const Vec2 push = push_of(run, 0);
        const Equilibrium::Contacts contacts = run.equilibrium.contacts();
        double spring = 1e30;
        for (const Grip& grip : contacts.bodies[0]) if (grip.stretch != 0) spring = std::min(spring, grip.limit / std::abs(grip.stretch));
        double low = 1, high = -1, edge_low = 1, edge_high = -1;
        for (const Grip& grip : contacts.bodies[0]) {
            const double x = run.body.facets[grip.place].position.x() - size;
            edge_low = std::min(edge_low, x);
            edge_high = std::max(edge_high, x);
            if (std::abs(grip.stretch) * spring < grip.limit * (1 - 1e-9)) low = std::min(low, x), high = std::max(high, x);
        }
        const double share = std::abs(push.x()) / (friction * P);
        std::printf("stick %.4f..%.4f mm of exact +-%.4f\n", 1e3*low, 1e3*high, 1e3*a*std::sqrt(std::max(0.0, 1-share)));
        const int now = run.equilibrium.factorisations();
        std::printf("%d: Q / (mu P) %.4f, touch %.4f..%.4f mm (a %.4f), %d factorisations\n", k, std::abs(push.x()) / (friction * P), 1e3 * edge_low,
                    1e3 * edge_high, 1e3 * a, now - before);
        before = now;
    }
}

// F_H / F_V of a wedge of full angle A that goes down: on each flank N out and friction N down along it.
double wedge_ratio(double angle, double friction) {
    const double slope = std::tan(angle / 2);
    return (1 - friction * slope) / (2 * (slope + friction));
}

Scene wedge(double angle, double friction, bool wheels) {
    const double deep = 6e-3, slope = std::tan(angle / 2);
    Scene scene = at_rest({10e-3, 10e-3}, 0.2e-3);
    scene.specimen.cutouts = {Polygon{{Vec2(5e-3 - deep * slope, 10e-3), Vec2(5e-3 + deep * slope, 10e-3), Vec2(5e-3, 10e-3 - deep)}}};
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    for (const double side : {-1.0, 1.0}) {
        const auto at = [&](double up, double share) { return Vec2(5e-3 + side * share * slope * up, 10e-3 - deep + up); };
        Shape shape = Polygon{{at(2e-3, 0.5), at(2e-3, 1.0), at(8e-3, 1.0), at(8e-3, 0.5)}};
        const double radius = 0.3e-3;
        if (wheels) shape = Circle{at(5e-3, 1.0) + radius * Vec2(-side * std::cos(angle / 2), std::sin(angle / 2)), radius};
        scene.bodies.push_back(rough(side < 0 ? "left" : "right", shape, {0.0, -1e-3}, friction));
    }
    scene.measure = {"left", "left"};
    scene.stop.time = 0.2;
    return scene;
}

TEST(VerificationWedgeFriction, ForcesLeanByTheFrictionAngle) {
    for (const bool wheels : {false, true}) {
        for (const double degrees : {10.0, 20.0, 30.0, 53.13}) {
            for (const double friction : {0.0, 0.1, 0.3}) {
                const double angle = degrees * degree;
                StaticTrial run(wedge(angle, friction, wheels));
                ASSERT_TRUE(run.solve(0.01));
                ASSERT_TRUE(run.solve(0.02));
                const double across = 0.5 * (push_of(run, 1).x() - push_of(run, 0).x());
                const double down = -(push_of(run, 0).y() + push_of(run, 1).y());
                const double error = across / down / wedge_ratio(angle, friction) - 1;
                std::printf("%s, %4.1f degrees, friction %.1f: F_H / F_V %+.2f %%, %d factorisations\n", wheels ? "wheels" : "wedge in halves",
                            degrees, friction, 100 * error, run.equilibrium.factorisations());
                EXPECT_LT(std::abs(error), wheels ? 0.03 : 0.01);
            }
        }
    }
}

TEST(VerificationCrackFriction, ClosedSlantedCrack) {
    // Under pressure p and shear t a closed crack slides as if the shear were t - friction p (McClintock and Walsh 1962): that part of the
    // stress is the crack's, the rest is even.
    const double a = 10e-3, pressure = 1e6, friction = 0.3;
    for (const double shear : {0.8e6, -0.8e6, 0.2e6}) {
        const double slides = std::copysign(std::max(0.0, std::abs(shear) - friction * pressure), shear);
        const auto exact = [&](const Mat2& remote, double half, const Vec2& x) -> Mat2 {
            Mat2 own = Mat2::Zero();
            own(0, 1) = own(1, 0) = slides;
            return remote - own + griffith_stress(own, half, x);
        };
        for (const double angle : {0.0, 20.0, 45.0}) {
            for (const double offset : {0.0, 0.37}) {
                Mat2 own;
                own << 0.0, shear, shear, -pressure;
                const Vec2 along(std::cos(angle * degree), std::sin(angle * degree));
                Mat2 axes;
                axes << along, left_of(along);
                SlantedCrack c;
                c.cells = 10;
                c.angle = angle * degree;
                c.remote = axes * own * axes.transpose();
                c.offset = {0.0, offset};
                c.half_length = a;
                Scene scene = slanted_crack(c, exact);
                scene.cracks[0].faces = {CrackFaces::Kind::friction, friction};
                StaticTrial run(scene, false);
                ASSERT_TRUE(run.solve(0.0));
                const TipLoad tip = run.equilibrium.load_at(0, true), start = run.equilibrium.load_at(0, false);
                const double K = std::sqrt(std::numbers::pi * a), expected = slides * K;
                std::printf("shear %+.1f of the pressure, %2.0f degrees, offset %.2f: K_II %+.4f, %+.4f exact %+.4f, K_I %.4f (of p sqrt(pi a)), G %.4f of K_II^2 / E', %d factorisations\n",
                            shear / pressure, angle, offset, tip.K_II / pressure / K, start.K_II / pressure / K, expected / pressure / K,
                            tip.K_I / pressure / K, slides == 0 ? 0.0 : tip.G * plane_modulus() / (expected * expected), run.equilibrium.factorisations());
                EXPECT_NEAR(tip.K_II, expected, 0.02 * std::abs(shear) * K);
                EXPECT_NEAR(tip.K_I, 0.0, 0.02 * std::abs(shear) * K);
            }
        }
    }
}

}  // namespace
}  // namespace crampfit::test
