// Coulomb friction of bodies and of crack faces, and bodies that follow a force, against statics and exact solutions.
#include "datasets/error.hpp"
#include "forward/friction.hpp"
#include "tests/forward/scenes.hpp"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <numbers>
#include <random>
#include <utility>
#include <vector>

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

// Places joined by any compliance: what is found is each one's own law, and open, gripping and sliding ones are among them.
TEST(UnitFriction, ManyPlacesEachFollowTheirLaw) {
    std::mt19937 random(3);
    const auto between = [&](double low, double high) { return low + (high - low) * 0x1p-32 * static_cast<double>(random()); };
    int open = 0, grips = 0, slides = 0;
    for (int trial = 0; trial < 50; ++trial) {
        constexpr int count = 8;
        const double k = 1e9, joint = 1e7;
        Eigen::MatrixXd root(2 * count, 2 * count);
        for (Eigen::Index i = 0; i < root.size(); ++i) root(i) = between(-1.0, 1.0);
        const Eigen::MatrixXd wood = 2e7 * (root.transpose() * root + Eigen::MatrixXd::Identity(2 * count, 2 * count));  // N/m
        const Eigen::MatrixXd compliance = (wood + joint * Eigen::MatrixXd::Identity(2 * count, 2 * count)).inverse();
        std::vector<RubbingPlace> places;
        Eigen::VectorXd without(2 * count);
        for (int i = 0; i < count; ++i) {
            const double angle = between(-3.0, 3.0);
            places.push_back({.normal = {std::cos(angle), std::sin(angle)},
                              .stiffness = k,
                              .coefficient = between(0.1, 0.6),
                              .apart = Vec2::Zero(),
                              .apart_before = Vec2::Zero(),
                              .stretch = 0.0,
                              .joint = joint});
            without.segment<2>(2 * i) << between(-1e-5, 1e-5), between(-1e-5, 1e-5);
        }
        const Eigen::VectorXd forces = balance_of_rubbing(places, compliance, without);
        const Eigen::VectorXd steps = without + compliance * forces;
        const double hair = 1e-8 * forces.norm();
        for (int i = 0; i < count; ++i) {
            const RubbingPlace& place = places[i];
            const Vec2 step = steps.segment<2>(2 * i), force = forces.segment<2>(2 * i) - joint * step;
            EXPECT_LT((force - place.force(step)).norm(), hair);
            const double pressed = force.dot(place.normal), drag = std::abs(force.dot(left_of(place.normal)));
            EXPECT_GE(pressed, -hair);
            EXPECT_LE(drag, place.coefficient * pressed + hair);
            (pressed <= hair ? open : drag < 0.999 * place.coefficient * pressed ? grips : slides)++;
        }
    }
    std::printf("%d open, %d grip, %d slide\n", open, grips, slides);
    EXPECT_GT(std::min({open, grips, slides}), 20);
}

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
            std::printf("friction %.1f, gone %.1f mm: drag over push %.7f, %d factorisations\n", friction, 0.1 * k,
                        push.x() / push.y(), run.equilibrium.factorisations());
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

// The specimen is cut right through along a slope of 20 degrees, and pressed from above.
TEST(VerificationFriction, ASlopeThatSlipsIsNoMistakeOfTheScene) {
    for (const double friction : {0.36, 0.37}) {  // tan 20 degrees = 0.364
        Scene scene = at_rest({20e-3, 20e-3}, 1e-3);
        scene.edges = {pulled("top", Side::top, {0.0, -1e4}), moving("bottom", Side::bottom, {0.0, 0.0})};
        Crack& cut = scene.cracks.emplace_back();
        cut.points = {{-0.5e-3, 6.2783e-3}, {20.5e-3, 13.9217e-3}};
        cut.faces = {CrackFaces::Kind::friction, friction};
        scene.measure = {"top", "top"};
        scene.stop = {};
        scene.stop.time = 1.0;
        scene.solver.kind = SolverKind::quasistatic;
        const Record record = simulate(scene);
        std::printf("slope of 20 degrees, friction %.2f: %s\n", friction, record.message.c_str());
        EXPECT_EQ(record.status == RunStatus::finished, friction > 0.364);
        if (friction < 0.364) {
            EXPECT_NE(record.message.find("the load may be more than friction can hold"), std::string::npos);
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
        std::printf("friction %.1f: force %.4f N, way %.8f mm of -0.05 mm, %d and %d factorisations\n", friction,
                    push_of(by_way, 0).y(), 1e3 * way, by_way.equilibrium.factorisations(),
                    by_force.equilibrium.factorisations());
        EXPECT_NEAR(push_of(by_force, 0).y(), push_of(by_way, 0).y(), 1e-6 * std::abs(push_of(by_way, 0).y()));
        EXPECT_NEAR(way, -0.05e-3, (friction > 0 ? 1e-3 : 1e-6) * 0.05e-3);
    }
}

TEST(SlowVerificationFriction, PartialSlipOfAWheel) {
    // Cattaneo (1938) and Mindlin (1949) for cylinders (Johnson 1985, eqs. 7.24 to 7.28): a wheel that is pressed by P and then
    // pushed aside by Q slips from both edges in to c = a (1 - Q / (mu P))^1/2, and the traction that is left of Coulomb's is
    // half an ellipse on c more: the integral of q x^2 is mu P / 4 (a^2 - c^4 / a^2). This holds where pressing shifts nothing
    // aside, at nu = 1/2; at 0.45 it is a quarter of what it is at 0.33.
    const double nu = 0.45, size = 2.4e-3, cell = 0.03e-3, friction = 0.3, P = 1e3;
    Scene scene = hertz(friction, nu, cell, size);
    scene.bodies[0].velocity = {1e-3, 0.0};
    scene.bodies[0].free = {false, true};
    scene.bodies[0].force = {0.0, -P};
    StaticTrial run(scene, false);
    ASSERT_TRUE(run.solve(0.0));
    for (int k = 1; k <= 5; ++k) {
        ASSERT_TRUE(run.solve(0.004 * k)) << k;
        const double Q = std::abs(push_of(run, 0).x());
        const Equilibrium::Contacts contacts = run.equilibrium.contacts();
        SlidingBody same(scene.bodies[0].shape, run.body, friction);
        const Vec2 moved(4e-6 * k, contacts.moved[1].y());
        same.restore(contacts.bodies[0], 0.0, moved, run.equilibrium.displacements());
        double low = size, high = -size, total = 0, spread = 0, drag = 0;
        for (const SlidingBody::Touch& touch : same.touches(moved, run.equilibrium.displacements())) {
            const double x = run.body.facets[touch.facet].position.x() - size, held = touch.drag.force.x();
            total += touch.drag.limit;
            spread += touch.drag.limit * x * x;
            drag += held * x * x;
            if (touch.drag.force.norm() > touch.drag.limit * (1 - 1e-6)) continue;
            low = std::min(low, x);
            high = std::max(high, x);
        }
        const double a = 2 * std::sqrt(spread / total), share = Q / (friction * P), c = a * std::sqrt(1 - share);
        const double exact = 0.25 * friction * P * (a * a - c * c * c * c / (a * a));
        std::printf("Q = %.3f mu P: sticks within %.1f %% of the half width, exact %.1f %%; moment of the drag %+.1f %%\n", share,
                    50 * (high - low) / a, 100 * c / a, 100 * (drag / exact - 1));
        EXPECT_NEAR(0.5 * (high - low), c, cell);
        EXPECT_NEAR(drag, exact, 0.05 * exact);
    }
}

constexpr double slope_two = 0.9272952180016122;  // full angle of a notch whose flanks have slope 2: 2 atan(1/2)

// F_H / F_V of a wedge of full angle A that goes down: on each flank N out and friction N down along it.
double wedge_ratio(double angle, double friction) {
    const double slope = std::tan(angle / 2);
    return (1 - friction * slope) / (2 * (slope + friction));
}

Scene wedge(double angle, double friction, bool wheels) {
    const double deep = 6e-3, slope = std::tan(angle / 2);
    Scene scene = at_rest({10e-3, 10e-3}, 0.2e-3);
    scene.specimen.cutouts = {
        Polygon{{Vec2(5e-3 - deep * slope, 10e-3), Vec2(5e-3 + deep * slope, 10e-3), Vec2(5e-3, 10e-3 - deep)}}};
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
        for (const double degrees : {10.0, 20.0, 30.0}) {
            for (const double friction : {0.0, 0.1, 0.3}) {
                const double angle = degrees * degree;
                StaticTrial run(wedge(angle, friction, wheels));
                ASSERT_TRUE(run.solve(0.01));
                ASSERT_TRUE(run.solve(0.02));
                const double across = 0.5 * (push_of(run, 1).x() - push_of(run, 0).x());
                const double down = -(push_of(run, 0).y() + push_of(run, 1).y());
                const double error = across / down / wedge_ratio(angle, friction) - 1;
                std::printf("%s, %4.1f degrees, friction %.1f: F_H / F_V %+.2f %%, %d factorisations\n",
                            wheels ? "wheels" : "wedge in halves", degrees, friction, 100 * error,
                            run.equilibrium.factorisations());
                EXPECT_LT(std::abs(error), wheels ? 0.03 : 0.01);
            }
        }
    }
}

TEST(VerificationCrackFriction, ClosedSlantedCrack) {
    // Under pressure p and shear t a closed crack slides as if the shear were t - friction p (McClintock and Walsh 1962): K_II is
    // that of this part alone, the rest of the stress is even.
    const double a = 10e-3, pressure = 1e6, K0 = pressure * std::sqrt(std::numbers::pi * a);
    double worst = 0, worst_G = 0;
    for (const double friction : {0.0, 0.3}) {
        for (const double shear : {0.8e6, -0.8e6, 0.2e6}) {
            const double slides = std::copysign(std::max(0.0, std::abs(shear) - friction * pressure), shear);
            const auto exact = [&](const Mat2& remote, double half, const Vec2& x) -> Mat2 {
                Mat2 own = Mat2::Zero();
                own(0, 1) = own(1, 0) = slides;
                return remote - own + griffith_stress(own, half, x);
            };
            for (const double angle : {0.0, 20.0, 45.0}) {
                for (const double offset : {0.0, 0.37}) {
                    Mat2 own, axes;
                    own << 0.0, shear, shear, -pressure;
                    const Vec2 along(std::cos(angle * degree), std::sin(angle * degree));
                    axes << along, left_of(along);
                    SlantedCrack c;
                    c.angle = angle * degree;
                    c.remote = axes * own * axes.transpose();
                    c.offset = {0.0, offset};
                    Scene scene = slanted_crack(c, exact);
                    scene.cracks[0].faces = {CrackFaces::Kind::friction, friction};
                    StaticTrial run(scene, false);
                    ASSERT_TRUE(run.solve(0.0));
                    for (const bool at_end : {false, true}) {
                        const TipLoad tip = run.equilibrium.load_at(0, at_end);
                        const double wanted = slides * std::sqrt(std::numbers::pi * a);
                        const double G = tip.G * plane_modulus() / (K0 * K0), exact_G = wanted * wanted / (K0 * K0);
                        std::printf("friction %.1f, shear %+.1f p, %2.0f degrees, %.2f cells off: ", friction, shear / pressure,
                                    angle, offset);
                        std::printf("K_II %+.3f of K0, exact %+.3f; K_I %.3f; G %.3f, exact %.3f\n", tip.K_II / K0, wanted / K0,
                                    tip.K_I / K0, G, exact_G);
                        worst = std::max(worst, std::abs(tip.K_II - wanted) / K0);
                        worst_G = std::max(worst_G, std::abs(G - exact_G));
                        EXPECT_NEAR(tip.K_II, wanted, 0.03 * K0);
                        EXPECT_NEAR(G, exact_G, 0.03);
                        EXPECT_LT(tip.K_I, 0.03 * K0);
                    }
                }
            }
        }
    }
    std::printf(
        "closed slanted cracks, 10 cells per half crack: K_II within %.3f of p (pi a)^1/2, G within %.3f of its square over E'\n",
        worst, worst_G);
}

// A block that a crack crosses as a whole, its top held by an edge that goes aside and down.
Scene cut_block(double friction, Vec2 top, double height) {
    Scene scene = block({10e-3, 5e-3}, 0.5e-3);
    scene.edges = {moving("top", Side::top, top), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(-1e-3, height), Vec2(11e-3, height)};
    crack.faces = {CrackFaces::Kind::friction, friction};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    return scene;
}

TEST(VerificationCrackFriction, FacesSlideAtTheCoefficientTimesTheirPressure) {
    for (const double height : {2.5e-3, 2.6e-3, 2.75e-3}) {
        for (const double friction : {0.1, 0.3}) {
            // The edge goes aside so far that all of the faces slide.
            Scene scene = at_equilibrium(cut_block(friction, {4e-4, -2e-4}, height));
            scene.stop.time = 1.0;
            StaticTrial run(scene, false);
            for (const double time : {0.5, 1.0}) ASSERT_TRUE(run.solve(time));
            const Vec2 top = run.equilibrium.reactions()[0];
            std::printf("cut at %.2f mm, friction %.1f: shear over pressure %.7f, %d factorisations\n", 1e3 * height, friction,
                        -top.x() / top.y(), run.equilibrium.factorisations());
            EXPECT_NEAR(-top.x() / top.y(), friction, 1e-5 * friction);
        }
    }
}

TEST(VerificationCrackFriction, FacesThatHoldAreAsOneBlock) {
    for (const double height : {2.5e-3, 2.75e-3}) {
        Scene scene = at_equilibrium(cut_block(0.5, {0.2e-4, -1e-4}, height));
        scene.stop.time = 1.0;
        StaticTrial cut(scene, false);
        scene.cracks.clear();
        StaticTrial whole(scene, false);
        ASSERT_TRUE(cut.solve(1.0));
        ASSERT_TRUE(whole.solve(1.0));
        const Vec2 ratio = cut.equilibrium.reactions()[0].cwiseQuotient(whole.equilibrium.reactions()[0]);
        std::printf("cut at %.2f mm, below the friction: force over a whole block's %.5f, %.5f\n", 1e3 * height, ratio.x(),
                    ratio.y());
        EXPECT_NEAR(ratio.x(), 1.0, 5e-3);  // faces yield by a hundredth of a cell
        EXPECT_NEAR(ratio.y(), 1.0, 5e-3);
    }
}

// Momentum of all wood above a height [kg m/s].
Vec2 momentum_above(const Trial& run, double height) {
    Vec2 sum = Vec2::Zero();
    for (int p = 0; p < run.body.points.count(); ++p)
        if (run.body.points.position[p].y() > height)
            sum += run.body.points.mass[p] * value_at(run.body, p, run.solver.velocities());
    return sum;
}

Scene pushed_block(double shear, double pressure) {
    Scene scene = block({20e-3, 3e-3}, 0.5e-3);
    scene.edges = {pulled("top", Side::top, {shear, -pressure})};
    scene.measure = {"top", "top"};
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.stop.time = 1e-3;
    return scene;
}

// Rests on a plate, or on its lower half that a crack cuts off.
void put_down(Scene& scene, bool crack, double friction) {
    if (crack) {
        scene.edges.push_back(moving("bottom", Side::bottom, {0.0, 0.0}));
        scene.cracks = cut_block(friction, {0.0, 0.0}, 1.5e-3).cracks;
        scene.cracks[0].points[1].x() = 21e-3;
    } else {
        scene.bodies = {rough("plate", rectangle({-5e-3, -2e-3}, {30e-3, 0.0}), {0.0, 0.0}, friction)};
    }
}

TEST(VerificationFrictionInMotion, ABlockSlidesAsCoulombSays) {
    // Pushed by s and pressed by p it gains the momentum m_x = s L t - friction (p L t + m_y): what presses on the plate is p L
    // less what lifts the block.
    const double pressure = 1e4, shear = 0.3e4, friction = 0.1, time = 1e-3, length = 20e-3;
    for (const bool crack : {false, true}) {
        Scene scene = pushed_block(shear, pressure);
        put_down(scene, crack, friction);
        Trial run(scene);
        run.until(time);
        const Vec2 gained = momentum_above(run, crack ? 1.5e-3 : 0.0);
        const double exact = shear * length * time - friction * (pressure * length * time + gained.y());
        const EnergyBooks books = run.solver.energies();
        const double kept = books.strain + books.kinetic + books.contact + books.damped;
        std::printf("%s: momentum %+.2f %% off, energy %+.2f %% of the work off, %.1f %% of it dissipated\n",
                    crack ? "crack faces" : "plate", 100 * (gained.x() / exact - 1), 100 * (kept / books.work - 1),
                    100 * books.damped / books.work);
        EXPECT_NEAR(gained.x(), exact, 0.01 * exact);
        EXPECT_NEAR(kept, books.work, 0.01 * books.work);
    }
}

TEST(VerificationFrictionInMotion, BelowItsFrictionItComesToRest) {
    const double pressure = 1e4, shear = 0.3e4, friction = 0.5, length = 20e-3, time = 1e-3;
    for (const bool crack : {false, true}) {
        Scene scene = pushed_block(shear, pressure);
        scene.solver.damping = 1e5;
        put_down(scene, crack, friction);
        Trial run(scene);
        run.until(time);
        const double momentum = momentum_above(run, crack ? 1.5e-3 : 0.0).x() / (shear * length * time);
        const Vec2 held = run.solver.reactions()[1] / length;
        std::printf("%s: at rest with momentum %.1e of what the push alone gives, holds %.5f of the push, %.5f of the pressure\n",
                    crack ? "crack faces" : "plate", momentum, -held.x() / shear, held.y() / pressure);
        EXPECT_LT(std::abs(momentum), 1e-4);
        EXPECT_NEAR(held.x(), -shear, 1e-3 * shear);
        EXPECT_NEAR(held.y(), pressure, 1e-3 * pressure);
    }
}

TEST(VerificationFrictionInMotion, WheelsOnFlanksLeanByTheFrictionAngle) {
    // While they go down at 0.3 m/s, after the first few waves: 0.1 mm in all.
    for (const double friction : {0.0, 0.3}) {
        Scene scene = wedge(slope_two, friction, true);
        scene.solver = {};
        scene.solver.kind = SolverKind::explicit_dynamics;
        for (Body& wheel : scene.bodies) wheel.velocity *= 300.0;
        scene.stop.time = 3e-4;
        const Record record = simulate(scene);
        double across = 0, down = 0;
        for (std::size_t i = record.series.size() / 3; i < record.series.size(); ++i) {
            const Vec2 left = record.reactions[1].force[i], right = record.reactions[2].force[i];
            across += 0.5 * (right.x() - left.x());
            down -= left.y() + right.y();
        }
        const double error = across / down / wedge_ratio(slope_two, friction) - 1;
        std::printf("wheels in motion, friction %.1f: F_H / F_V %+.2f %%, energy off by %.2f %%\n", friction, 100 * error,
                    100 * record.worst_energy_imbalance);
        EXPECT_LT(std::abs(error), 0.03);
        EXPECT_LT(record.worst_energy_imbalance, 0.01);
    }
}

TEST(VerificationFriction, WorkIsStoredOrDissipated) {
    // Wheels on the flanks of a notch roll 0.2 mm down: their work, by the trapezoid rule over the increments, against the
    // potential.
    StaticTrial run(wedge(slope_two, 0.3, true), false);
    double work = 0, power = 0, worst = 0;
    const int steps = 32;
    for (int k = 1; k <= steps; ++k) {
        ASSERT_TRUE(run.solve(0.2 * k / steps));
        const double before = std::exchange(power, run.equilibrium.power());
        work += 0.5 * (before + power) * 0.2 / steps;
        worst = std::max(worst, std::abs(run.equilibrium.potential() - work));
    }
    std::printf("work %.5f J, %.1f %% of it dissipated, energy off by %.2f %%, %.1f factorisations a step\n", work,
                100 * run.equilibrium.dissipated() / work, 100 * worst / work, run.equilibrium.factorisations() / double(steps));
    EXPECT_LT(worst, 0.01 * work);
}

// A wedge test at 1 mm a second: wheels with friction split a block.
Scene splitting(double friction) {
    Scene scene = wedge(slope_two, friction, true);
    Crack crack;
    crack.points = {Vec2(5e-3, 4e-3), Vec2(5e-3, 3.5e-3)};
    crack.grows = Growth::end;
    crack.advance = 0.4e-3;
    crack.direction = GrowthDirection::straight;
    scene.cracks = {crack};
    scene.materials["EW"].toughness = 20.0;
    scene.solver.extrapolate = false;
    scene.stop.time = 0.6;
    return scene;
}

TEST(SlowSystemFriction, AWedgeSplitsABlock) {
    double work[2];
    for (const int rubs : {0, 1}) {
        const Record record = simulate(splitting(0.3 * rubs));
        EXPECT_NE(record.status, RunStatus::unstable) << record.message;
        const Instant& last = record.series.back();
        std::printf(
            "friction %.1f: crack %.3f mm, work %.4f J, fracture %.4f J, strain %.4f J, energy off by %.2f %%, %ld equilibria\n",
            0.3 * rubs, 1e3 * last.crack_length, last.external_work, last.fracture_energy, last.strain_energy,
            100 * record.worst_energy_imbalance, record.steps);
        work[rubs] = last.external_work;
    }
    EXPECT_GT(work[1], 1.2 * work[0]);  // friction takes its part
}

TEST(UnitFreeBody, IsRefusedWhereItCannotMove) {
    const auto refused = [](auto change, const std::string& key, const std::string& rule) {
        Scene scene = on_a_plate(0.3, 1e3);
        change(scene);
        try {
            simulate(scene);
            ADD_FAILURE() << "accepted " << key;
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, key);
            EXPECT_NE(std::string(error.what()).find(rule), std::string::npos) << error.what();
        }
    };
    refused([](Scene& s) { s.solver.kind = SolverKind::explicit_dynamics; }, "bodies.plate.velocity", "mass");
    refused([](Scene& s) { s.bodies[0].force = {0.0, -1.0}; }, "bodies.plate.force", "meets nothing");
}

TEST(VerificationFreeBody, AGripThatFollowsItsForceIsTheSameAsOneThatIsMoved) {
    // Linear: a grip is moved aside and up, then only up with the force aside that this took; also with an edge that presses from
    // the side.
    Scene scene = at_rest({5e-3, 10e-3}, 0.5e-3);
    scene.edges = {moving("bottom", Side::bottom, {0.0, 0.0})};
    Body grip = rough("grip", rectangle({-1e-3, 9e-3}, {6e-3, 11e-3}), {2e-5, 1e-4}, 0.0);
    grip.contact.kind = Contact::Kind::bonded;
    scene.bodies = {grip};
    scene.measure = {"grip", "grip"};
    StaticTrial moved(scene, false);
    ASSERT_TRUE(moved.plan.linear);
    ASSERT_TRUE(moved.solve(1.0));
    scene.bodies[0].velocity.x() = 0.0;
    scene.bodies[0].free = {true, false};
    scene.bodies[0].force = {push_of(moved, 0).x(), 0.0};
    StaticTrial follows(scene, false);
    ASSERT_TRUE(follows.solve(1.0));
    EXPECT_NEAR(follows.equilibrium.contacts().moved[1].x(), 2e-5, 1e-9 * 2e-5);
    EXPECT_NEAR(push_of(follows, 0).y(), push_of(moved, 0).y(), 1e-7 * push_of(moved, 0).y());
    EXPECT_EQ(follows.equilibrium.factorisations(), 1);
    // Records are the same too: the force works, the way is known after.
    const Record record = simulate(scene);
    EXPECT_EQ(record.status, RunStatus::finished);
    EXPECT_NEAR(record.reactions[1].force.back().x(), scene.bodies[0].force.x(), 1e-7 * std::abs(scene.bodies[0].force.x()));
    EXPECT_NEAR(record.reactions[1].force.back().y(), push_of(moved, 0).y(), 1e-7 * push_of(moved, 0).y());
}

}  // namespace
}  // namespace crampfit::test
