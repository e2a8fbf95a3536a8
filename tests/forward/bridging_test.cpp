// Crack faces that a softening traction pulls together, against closed forms.
#include "datasets/error.hpp"
#include "tests/forward/scenes.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <initializer_list>
#include <utility>

namespace crampfit::test {
namespace {

// The energy of a law that faces have taken when they are open so far, without having closed.
double taken(const Bridging& law, double opening) {
    const double reached = std::min(opening, law.opening);
    return law.stress * reached * (1.0 - 0.5 * reached / law.opening);
}

TEST(UnitBridging, TractionIsTheSlopeOfItsEnergy) {
    const Bridging law{2e6, 0.1e-3};
    for (const double steepest : {1e10, 5e10, 1e13}) {
        for (const double largest : {1e-6, 30e-6, 90e-6, 120e-6}) {
            const BridgeState open = bridge_state(law, steepest, largest, largest);
            EXPECT_NEAR(open.traction, largest < law.opening ? law.stress * (1 - largest / law.opening) : 0.0, 1e-6);
            EXPECT_NEAR(open.stored + open.dissipated, taken(law, largest), 1e-9);
            for (const double share : {0.2, 0.5, 0.8}) {  // on the way back and forth nothing is dissipated
                const double step = 1e-3 * largest;
                const BridgeState before = bridge_state(law, steepest, largest, share * largest - step);
                const BridgeState after = bridge_state(law, steepest, largest, share * largest + step);
                const BridgeState here = bridge_state(law, steepest, largest, share * largest);
                EXPECT_NEAR((after.stored - before.stored) / (2 * step), here.traction, 1e-6 * law.stress);
                EXPECT_NEAR(here.dissipated, open.dissipated, 1e-9);
            }
            if (steepest * largest >= law.stress) {
                EXPECT_EQ(bridge_state(law, steepest, largest, 0.0).traction, 0.0);
            }
        }
        EXPECT_EQ(bridge_state(law, steepest, 0.0, 0.0).traction, law.stress);  // rigid until it opens
    }
}

constexpr double drawing_speed = 0.02;   // [m/s]
constexpr Bridging fibres{2e6, 0.1e-3};  // 100 J/m^2

// Two halves of a block that bridged faces alone join are drawn apart by `widest`, and then come back.
Scene two_halves(Vec2 from, Vec2 to, double widest) {
    Scene scene = at_motion(block({2e-3, 2e-3}, 0.25e-3));
    scene.materials["EW"].youngs_modulus = 400e6;
    scene.edges = {without(moving("top", Side::top, {0.0, 2.0 * drawing_speed}), 0),
                   without(moving("bottom", Side::bottom, {0.0, drawing_speed}), 0)};
    scene.edges[0].until = widest / drawing_speed;
    Crack crack;
    crack.points = {from, to};
    crack.faces.bridging = fibres;
    crack.faces.bridging->on_all_faces = true;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.time = 1.9 * widest / drawing_speed;
    return scene;
}

TEST(VerificationBridging, TwoHalvesFollowTheLaw) {
    // Equilibrium of two halves that stretch evenly: the stress is the law's at the opening that their stretch, stress height /
    // E', leaves; on the way back it goes with the opening. Waves of the start, density times their speed times that of the
    // drawing, are 0.4 % of the stress.
    const double modulus = 400e6 / (1 - 0.33 * 0.33), height = 2e-3, width = 2e-3;
    const double waves = drawing_speed * std::sqrt(300.0 * modulus) / fibres.stress;
    for (const double y : {1e-3, 1.125e-3, 1.05e-3}) {  // on nodes, between them, and near them
        for (const double widest : {0.05e-3, 0.12e-3}) {
            const Record record = simulate(two_halves({-1e-3, y}, {3e-3, y}, widest));
            double worst = 0.0, furthest = 0.0, work = 0.0, stretch = 0.0;
            for (const Instant& row : record.series) {
                const double stress = row.force / width,
                             opening = row.displacement - drawing_speed * row.time - stress / modulus * height;
                furthest = std::max(furthest, opening);
                const bool goes_apart = row.time < widest / drawing_speed;
                const double most = std::max(0.0, fibres.stress * (1 - furthest / fibres.opening));
                if (opening > 2e-6)
                    worst = std::max(worst, std::abs(stress - (goes_apart ? most : most * opening / furthest)) / fibres.stress);
                if (goes_apart) work = row.external_work, stretch = 0.5 * stress * stress / modulus * height;
            }
            const double off = work / width / (taken(fibres, furthest) + stretch) - 1;
            std::printf("crack at %.3f mm, drawn apart by %.2f mm: stress off by %.2f %% of the law's, work by %+.3f %%, books "
                        "by %.3f %%\n",
                        1e3 * y, 1e3 * widest, 100 * worst, 100 * off, 100 * record.worst_energy_imbalance);
            EXPECT_LT(worst, 2.0 * waves);
            EXPECT_LT(std::abs(off), 0.005);
            EXPECT_LT(record.worst_energy_imbalance, 0.01);
            if (widest > fibres.opening) {
                EXPECT_NEAR(record.series.back().fracture_energy, fibres.energy() * width, 1e-6 * fibres.energy() * width);
                EXPECT_LT(std::abs(record.series.back().force), 2.0 * waves * fibres.stress * width);
            }
        }
    }
}

TEST(VerificationBridging, FacesOfASlantedCrackAddUp) {
    // Drawn apart along the normal of the crack, both halves as a whole, faces carry the stress times their length, whatever the
    // grid.
    for (const double angle : {10.0, 30.0, 45.0, 70.0}) {
        const Vec2 along(std::cos(angle * degree), std::sin(angle * degree)), middle(1.03e-3, 0.96e-3);
        Scene scene = two_halves(middle - 4e-3 * along, middle + 4e-3 * along, 0.05e-3);
        Trial run(scene);
        std::vector<double> mass = field_masses(run.body, run.solver.cracks().fields());
        BridgedFaces faces(scene, run.body, run.solver.cracks(), mass, 1e15);
        std::vector<Vec2> moved(mass.size(), Vec2::Zero()), force(mass.size(), Vec2::Zero());
        for (const FieldPair& pair : run.solver.cracks().pairs) moved[pair.left] = 20e-6 * pair.normal;
        FaceNormals normals;
        normals.take_in(run.body, run.solver.cracks(), false);
        faces.pull(run.solver.cracks(), normals, moved, force);
        Vec2 left = Vec2::Zero();
        for (const FieldPair& pair : run.solver.cracks().pairs) left += force[pair.left];
        const double length = run.solver.cracks().lines[0].length, wanted = fibres.stress * 0.8 * length;
        std::printf("crack at %.0f degrees: traction over its length off by %+.3f %%\n", angle,
                    100 * (-left.dot(left_of(along)) / wanted - 1));
        EXPECT_NEAR(-left.dot(left_of(along)), wanted, 0.01 * wanted);  // places at a side count whole or not, 1/16 of a cell
    }
}

// A strip between grips that are drawn apart slowly, its notch on the left. Far behind the tip nothing is left, far ahead the
// strain is even: G = C u^2 / h, C the modulus of wood that cannot contract aside, whatever the length of the crack (REFERENCES:
// strip).
Scene strip(double cell, double lift, double speed, std::optional<Bridging> law) {
    Scene scene = at_motion(block({16e-3, 4e-3}, cell));
    scene.edges = {moving("top", Side::top, {0.0, speed}), moving("bottom", Side::bottom, {0.0, -speed})};
    Crack crack;
    crack.points = {Vec2(0, 2e-3 + lift), Vec2(5e-3, 2e-3 + lift)};
    crack.grows = Growth::end;
    crack.direction = GrowthDirection::straight;
    crack.faces.bridging = law;
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.solver.damping = 2e4;
    scene.stop.crack_length = 5.8e-3;  // the faces at the notch are free again by then
    return scene;
}

TEST(VerificationBridging, GAtTheTipIsWhatBridgesLeave) {
    // Rice (1968): of G far away a zone of bridges that are all broken at its far end takes the energy of the law. The zone is
    // about 8 cells long; wherever in a cell the tip lies, and the crack.
    const double u = 82e-6, speed = 0.1, half_height = 4e-3, cell = 0.2e-3;
    const double far = 40e6 * (1 - 0.33) / (1.33 * 0.34) * u * u / half_height;
    const Bridging law{0.5e6, 0.15e-3, true};
    for (const auto& [tip, lift] : {std::pair{16.03e-3, 0.0}, {16.1e-3, 0.3}, {15.96e-3, 0.5}}) {
        Scene scene = strip(cell, 0.0, speed, law);
        scene.specimen.size = {32e-3, 2 * half_height};
        for (Edge& edge : scene.edges) edge.until = u / speed;
        scene.cracks[0].points = {Vec2(0, half_height + lift * cell), Vec2(tip, half_height + lift * cell)};
        scene.cracks[0].grows = Growth::none;
        scene.solver.damping = 3e4;
        scene.stop = {};
        scene.stop.time = 1.3e-3;
        const Instant end = simulate(scene).series.back();
        std::printf("tip at %.2f mm, crack %.1f of a cell up: G off by %+.2f %%, K_I^2 / E' by %+.2f %% of that far away\n",
                    1e3 * tip, lift, 100 * (end.G - far + law.energy()) / far,
                    100 * (end.K_I * end.K_I / plane_modulus() - far + law.energy()) / far);
        EXPECT_NEAR(end.G, far - law.energy(), 0.03 * far);
        EXPECT_NEAR(end.K_I * end.K_I / plane_modulus(), far - law.energy(), 0.03 * far);
    }
}

struct Growing {
    double far;  // G far from the tip [J/m^2]
    double tip;  // J there, a mean [J/m^2]
};

Growing growing(const Scene& scene) {
    const Record record = simulate(scene);
    const double constrained = 40e6 * (1 - 0.33) / (1.33 * 0.34);
    const Instant& end = record.series.back();
    double sum = 0.0;
    int rows = 0;
    for (const Instant& row : record.series) {
        if (row.crack_length < 5.4e-3) continue;
        sum += row.G;
        ++rows;
    }
    EXPECT_LT(record.worst_energy_imbalance, 0.01);
    return {constrained * end.displacement * end.displacement / 2e-3, sum / rows};
}

// Suo, Bao and Fan (1992): a crack whose zone has its full length grows at the toughness of the tip and the energy of the law.
// `most`: how far it may be off as a part of that. The grid's own part in it shows without bridges.
void check_growing(double cell, double lift, std::initializer_list<double> stresses, double most) {
    const Growing plain = growing(strip(cell, lift * cell, 0.02, std::nullopt));
    std::printf("cell %.2f mm, crack %.1f of one up: without bridges grows at %.1f of 100 J/m^2, J at the tip %.1f\n", 1e3 * cell,
                lift, plain.far, plain.tip);
    for (const double stress : stresses) {
        const Bridging law{stress, 0.1e-3};
        const Growing bridged = growing(strip(cell, lift * cell, 0.02, law));
        const double both = 100.0 + law.energy();
        std::printf("    with %.1f MPa to %.2f mm at %.1f of %.0f: %+.1f %%; J at the tip %.1f; bridges took %+.1f %% of %.0f\n",
                    1e-6 * stress, 1e3 * law.opening, bridged.far, both, 100 * (bridged.far / both - 1), bridged.tip,
                    100 * ((bridged.far - plain.far) / law.energy() - 1), law.energy());
        EXPECT_NEAR(bridged.far, both, most * both);
    }
}

TEST(VerificationBridging, GrowsAtTheEnergyOfTipAndBridges) { check_growing(0.2e-3, 0.0, {1e6, 1.5e6}, 0.06); }

TEST(SlowVerificationBridging, GrowsAtTheEnergyOfTipAndBridges) {
    check_growing(0.1e-3, 0.0, {1e6, 2e6}, 0.042);  // without bridges it is 5 % already, of which 2 are the strip's ends
    check_growing(0.1e-3, 0.5, {1e6, 2e6}, 0.05);
}

TEST(VerificationBridging, PullsOnWhereTheTipHasGoneThrough) {
    // What parts the specimen takes toughness and bridges, however long they outlast the tip.
    Scene scene = at_motion(block({8e-3, 6e-3}, 0.25e-3));
    scene.materials["EW"] = {.youngs_modulus = 400e6, .poisson_ratio = 0.3, .density = 500.0, .toughness = 100.0};
    scene.edges = {moving("top", Side::top, {0.0, 0.5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(0.0, 3e-3), Vec2(4e-3, 3e-3)};
    crack.grows = Growth::end;
    crack.direction = GrowthDirection::straight;
    crack.faces.bridging = Bridging{1e6, 0.2e-3};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 3e-3;
    const Record record = simulate(scene);
    const double spent = record.series.back().fracture_energy / (4e-3 * scene.model.thickness);
    std::printf("bridged crack, gone through at %.3f mm or before: %.1f J/m^2 of 100 + 100; %s\n",
                1e3 * record.series.back().displacement, spent, record.message.c_str());
    EXPECT_EQ(record.status, RunStatus::split) << record.message;
    EXPECT_NEAR(spent, 200.0, 6.0);
}

TEST(UnitBridging, DoesNotDependOnThreads) {
    Scene scene = strip(0.2e-3, 0.06e-3, 0.2, Bridging{1e6, 0.1e-3});
    Record first;
    for (const int threads : {1, 2, 4}) {
        SimulateOptions options;
        options.threads = threads;
        const Record record = simulate(scene, options);
        if (threads == 1) first = record;
        EXPECT_EQ(record.series.back().force, first.series.back().force) << threads;
        EXPECT_EQ(record.series.back().fracture_energy, first.series.back().fracture_energy) << threads;
        EXPECT_EQ(record.series.back().time, first.series.back().time) << threads;
    }
}

void expect_refused(const Scene& scene, const std::string& key, const std::string& phrase) {
    try {
        explain(scene);
        FAIL() << "not refused: " << key;
    } catch (const InputError& error) {
        EXPECT_EQ(error.key, key);
        EXPECT_NE(error.rule.find(phrase), std::string::npos) << error.what();
    }
}

TEST(UnitBridging, SaysWhatItModelsAndWhatItCannot) {
    Scene scene = strip(0.2e-3, 0.0, 1e-6, Bridging{1e6, 0.1e-3});
    scene.solver.kind = SolverKind::automatic;
    scene.solver.damping = 0.0;
    const std::string text = explain(scene);
    EXPECT_NE(text.find("explicit dynamics"), std::string::npos) << text;
    EXPECT_NE(text.find("1 MPa falling to nothing at 0.1 mm: 50 J/m^2"), std::string::npos) << text;
    scene.cracks[0].faces.bridging->stress = 4e6;
    expect_refused(scene, "cracks.0.faces.traction.opening", "model.cell");
    scene.solver.kind = SolverKind::quasistatic;
    expect_refused(scene, "cracks.0.faces.traction", "equilibrium");
}

}  // namespace
}  // namespace crampfit::test
