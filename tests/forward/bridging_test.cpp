// Crack faces that a softening traction pulls together, against closed forms.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

constexpr Bridging fibres{2e6, 0.1e-3};  // 100 J/m^2

// Two halves of a stiff block, joined by bridged faces alone. They are drawn apart by `widest` and come back.
Scene two_halves(Vec2 from, Vec2 to, double widest) {
    Scene scene = at_motion(block({2e-3, 2e-3}, 0.25e-3));
    scene.materials["EW"].youngs_modulus = 400e6;
    const double speed = 0.02;
    scene.edges = {without(moving("top", Side::top, {0.0, 2.0 * speed}), 0), without(moving("bottom", Side::bottom, {0.0, speed}), 0)};
    scene.edges[0].until = widest / speed;
    Crack crack;
    crack.points = {from, to};
    crack.faces.bridging = fibres;
    crack.faces.bridging->on_all_faces = true;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.time = 1.8 * widest / speed;
    return scene;
}

double law(double opening) { return std::max(0.0, fibres.stress * (1.0 - opening / fibres.opening)); }

TEST(VerificationBridging, TwoHalvesFollowTheLaw) {
    // With the block's own compliance H / (C A) in series, C the modulus of a strip that cannot contract aside... its sides are free:
    // E' in plane strain.
    const double E = 400e6 / (1 - 0.33 * 0.33), height = 2e-3, speed = 0.02;
    for (const double y : {1e-3, 1.125e-3, 1.05e-3}) {
        for (const double widest : {0.03e-3, 0.06e-3, 0.12e-3}) {
            const Record record = simulate(two_halves({-1e-3, y}, {3e-3, y}, widest));
            double worst = 0.0, furthest = 0.0, work = 0.0;
            for (std::size_t i = 1; i < record.series.size(); ++i) {
                const Instant& row = record.series[i];
                const double stress = row.force / 2e-3;
                const double drawn = row.displacement - speed * row.time;
                const double opening = drawn - stress / E * height;
                furthest = std::max(furthest, opening);
                const bool loads = row.time < widest / speed;
                const double exact = loads ? law(opening) : law(furthest) * opening / furthest;
                if (opening > 2e-6) worst = std::max(worst, std::abs(stress - exact) / fibres.stress);
                if (loads) work = row.external_work;
            }
            const double reached = std::min(furthest, fibres.opening);
            const double taken = fibres.stress * reached * (1.0 - 0.5 * reached / fibres.opening) * 2e-3;
            std::printf("crack at %.3f mm, drawn apart by %.2f mm: stress off by %.2f %% of the largest, work by %+.2f %%, books by %.2f %%\n",
                        1e3 * y, 1e3 * widest, 100 * worst, 100 * (work / taken - 1), 100 * record.worst_energy_imbalance);
        }
    }
}

// A strip between grips that move apart, with a notch from the left: G far from the tip is E_c u^2 / h, whatever the crack's length.
Scene strip(double cell, double lift, bool bridged) {
    Scene scene = at_motion(block({24e-3, 4e-3}, cell));
    scene.edges = {moving("top", Side::top, {0.0, 0.05}), moving("bottom", Side::bottom, {0.0, -0.05})};
    Crack crack;
    crack.points = {Vec2(0, 2e-3 + lift), Vec2(6e-3, 2e-3 + lift)};
    crack.grows = Growth::end;
    crack.direction = GrowthDirection::straight;
    if (bridged) crack.faces.bridging = fibres;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.damping = 2e4;
    scene.stop.crack_length = 18e-3;
    return scene;
}

TEST(SlowVerificationBridging, Strip) {
    for (const double cell : {0.4e-3, 0.2e-3, 0.1e-3}) {
        for (const double lift : {0.0, 0.5, 0.3}) {
            for (const bool bridged : {false, true}) {
                Trial run(strip(cell, lift * cell, bridged));
                const double constrained = 40e6 * (1 - 0.33) / (1.33 * 0.34);
                std::printf("cell %.2f lift %.1f\n", cell * 1e3, lift);
                double next = 0.05e-3;
                while (run.solver.cracks().lines[0].length < 18e-3 && run.solver.time() < 4e-3) {
                    run.solver.grow_cracks();
                    run.solver.step();
                    const double gone = run.solver.cracks().lines[0].length - 6e-3;
                    if (gone < next) continue;
                    next = std::max(next * 1.5, gone);
                    const double u = 0.05 * run.solver.time();
                    const double far = constrained * u * u / 2e-3;
                    const double open = run.solver.cracks().opening(0, {6e-3, 2e-3}, run.solver.displacements()).y();
                    const double d = std::min(open, fibres.opening);
                    const TipLoad tip = run.solver.load_at(0, true);
                    const EnergyBooks b = run.solver.energies();
                    const double kept = b.strain + b.kinetic + b.contact + b.fracture + b.damped;
                    std::printf("  gone %6.3f mm: G far %7.2f, tip and bridging %7.2f (opening %.4f mm); J %.2f K^2/E' %.2f; books %+.3f %%\n", 1e3 * gone, far,
                                100 + (bridged ? fibres.stress * d * (1 - 0.5 * d / fibres.opening) : 0.0), 1e3 * open, tip.G,
                                tip.K_I * tip.K_I / plane_modulus(), 100 * (b.work / kept - 1));
                }
            }
        }
    }
}

}  // namespace
}  // namespace crampfit::test
