// Energies of a crack that crosses a sharp boundary between woods.
#include "forward/fine_tip.hpp"
#include "forward/tip_patch.hpp"
#include "tests/forward/cracked_plates.hpp"

#include "datasets/io.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace crampfit::test {
namespace {

using reference::two_woods;

// In boxes about the way from the tip as it is to the tip a little further, or about another way.
MissedEnergy missed_by(const AtRest& run, const std::vector<MaterialSlope>& numbers = {}, std::optional<Vec2> from = {},
                       double way = 0.0) {
    FineTip fine_tip(run.scene, run.plan, run.materials, run.body, numbers);
    if (!from) from = run.equilibrium.cracks().lines[0].end.position;
    const auto boxes = fine_tip.about(run.equilibrium.cracks(), {0, *from, *from + Vec2(way, 0.0)});
    return boxes ? fine_tip.missed({{*boxes, 0, true}}, run.equilibrium, !numbers.empty())[0] : MissedEnergy{};
}

// What the crack of a scene releases when it goes on by a way, by the grid alone and with what the boxes tell [J].
std::array<double, 2> released(const Scene& scene, double way) {
    AtRest run(scene);
    const Vec2 start = run.equilibrium.cracks().lines[0].end.position;
    const double before = run.equilibrium.potential(), missed_before = missed_by(run, {}, start, way).energy;
    run.equilibrium.grow(0, true, start + Vec2(way, 0.0));
    EXPECT_EQ(run.equilibrium.solve(1.0), Equilibrium::Outcome::solved);
    const double by_grid = before - run.equilibrium.potential();
    return {by_grid, by_grid + missed_before - missed_by(run, {}, start, way).energy};
}

TEST(VerificationFineTip, EnergyReleasedAcrossASharpBoundary) {
    // The reference is tests/forward/boundary_reference.py: finite elements of its own, good to 2e-4. The load that carries the
    // crack across goes with the root of the least of these rates, so that 3 % are half of that in the load.
    struct Reference {
        double boundary;
        std::array<double, 5> rate;
    };
    constexpr std::array<double, 5> starts{-0.4e-3, -0.2e-3, -0.1e-3, 0.0, 0.2e-3};  // of the way over 0.2 mm, from the boundary
    for (const auto& [boundary, exact] : {Reference{2.0e-3, {2.3332, 1.6504, 5.2023, 16.3620, 41.8034}},
                                          Reference{2.025e-3, {2.3416, 1.6550, 5.2150, 16.4026, 41.9218}},
                                          Reference{2.05e-3, {2.3496, 1.6593, 5.2272, 16.4426, 42.0413}}}) {
        for (std::size_t k = 0; k < starts.size(); ++k) {
            const auto [by_grid, all] = released(two_woods(boundary, boundary + starts[k], 0.1e-3), 0.2e-3);
            const double error = all / 0.2e-3 / exact[k] - 1;
            std::printf("boundary %.2f cells off a grid line, tip from %+.1f mm on: G over 0.2 mm off by %+.1f %%, without fine "
                        "boxes %+.1f %%\n",
                        (boundary - 2e-3) / 0.1e-3, 1e3 * starts[k], 100 * error, 100 * (by_grid / 0.2e-3 / exact[k] - 1));
            EXPECT_LT(std::abs(error), 0.03) << boundary << " " << starts[k];
        }
    }
}

// What a tip in motion is told of its next advance, in a specimen that stands still, by the patch's cells alone and with finer
// ones [J/m].
std::array<double, 2> told_in_motion(const Scene& scene, double advance, double held_at) {
    const AtRest still(scene);
    Trial run(at_motion(scene));
    const CrackFields &cracks = run.solver.cracks(), &same = still.equilibrium.cracks();
    std::vector<Vec2> u(still.equilibrium.displacements());
    u.resize(cracks.fields());
    for (const FieldPair& pair : cracks.pairs) {
        const auto there = std::ranges::find(same.pairs, pair.node, &FieldPair::node);
        for (const auto side : {&FieldPair::left, &FieldPair::right})
            u[pair.*side] = still.equilibrium.displacements()[there == same.pairs.end() ? pair.node : (*there).*side];
    }
    InternalForce wood(run.body, run.materials, false);
    TipPatch patch(run.body, wood, cracks, Boundary(run.scene, run.body, cracks), 0, true, advance, scene.model.cell, held_at);
    const double by_grid = patch.rates(0.0, u, {}).mean;
    const std::vector<MaterialSlope> none;
    FineTip fine(run.scene, run.plan, run.materials, run.body, none);
    patch.take_in(fine.ahead(cracks, 0, true, u, patch.ways_from(0.0), patch.box()), 0.0, u, {});
    return {by_grid, by_grid * patch.finer_share(0.0)};
}

// It is what that releases at equilibrium, where it is known (above).
TEST(VerificationFineTip, RateOverAnAdvanceInMotion) {
    constexpr double advance = 0.2e-3, middle = 6e-3;
    for (const double boundary : {middle, middle + 0.05e-3}) {
        for (const double start : {-0.4e-3, -0.2e-3, -0.1e-3, 0.0, 0.2e-3}) {
            Scene scene = two_woods(boundary, boundary + start, 0.1e-3);
            scene.specimen.size = {2 * middle, 2 * middle};
            for (Vec2& x : scene.cracks[0].points) x.y() = middle;
            const auto [by_grid, found] = told_in_motion(scene, advance, middle);
            const double exact = released(scene, advance)[1] / advance;
            std::printf(
                "boundary %.2f cells off a grid line, tip from %+.1f mm on: rate off by %+.1f %%, without fine boxes %+.1f %%\n",
                (boundary - middle) / 0.1e-3, 1e3 * start, 100 * (found / exact - 1), 100 * (by_grid / exact - 1));
            EXPECT_NEAR(found, exact, 0.04 * exact) << boundary << " " << start;
        }
    }
}

// In arms that end within the patch, a little beyond it, and twice as far away: G falls with the fourth power of the crack's
// length, and by as much as the arms are held far away.
TEST(VerificationTipPatch, ArmsOfACantilever) {
    for (const auto& [arm, advance] :
         {std::pair{6e-3, 0.6e-3}, {6e-3, 1e-3}, {6e-3, 2e-3}, {6e-3, 3e-3}, {10e-3, 0.55e-3}, {10e-3, 1e-3}}) {
        const double crack_length = 2.0 * arm;
        Scene scene = at_rest({6.0 * arm, 2.0 * arm}, 0.5e-3);
        scene.edges = {without(moving("low", Side::bottom, {0.0, 0.0}), 0), without(moving("up", Side::top, {0.0, 1e-3}), 0),
                       without(moving("right", Side::right, {0.0, 0.0}), 1)};
        scene.edges[0].range = scene.edges[1].range = {{0.0, 2e-3}};
        scene.edges[2].range = {{arm - 1e-3, arm + 1e-3}};
        Crack crack;
        crack.points = {Vec2(0.0, arm), Vec2(crack_length, arm)};
        crack.grows = Growth::end;
        scene.cracks = {crack};
        scene.measure = {"up", "up"};
        const double found = told_in_motion(scene, advance, std::hypot(crack_length - 2e-3, arm))[0];
        const double exact = released(scene, advance)[0] / advance;
        std::printf("cantilever, arms of %.0f mm, over %.2f mm: rate off by %+.1f %%\n", 1e3 * arm, 1e3 * advance,
                    100 * (found / exact - 1));
        EXPECT_NEAR(found, exact, 0.03 * exact) << advance;
    }
}

TEST(VerificationFineTip, WhereverInACellTheBoundaryLies) {
    // Over 0.2 mm that end at the boundary, where the least is released: the same reference, as a parabola in the boundary's
    // place.
    // Worst where it lies on a line of the finer cells.
    for (const auto& [cell, bar] : {std::pair{0.1e-3, 0.015}, std::pair{0.2e-3, 0.025}}) {
        double squares = 0.0, worst = 0.0;
        constexpr int places = 32;
        for (int k = 0; k < places; ++k) {
            const double boundary = 2e-3 + (static_cast<double>(k) / places - 0.25) * cell, n = (boundary - 2e-3) / 0.025e-3;
            const double exact = 1.6504 + 0.00475 * n - 0.00015 * n * n;
            const double error = released(two_woods(boundary, boundary - 0.2e-3, cell), 0.2e-3)[1] / 0.2e-3 / exact - 1;
            squares += error * error / places;
            worst = std::max(worst, std::abs(error));
        }
        std::printf("%.1f mm cells: off by %.2f %% in the root of the mean square, at most %.2f %%\n", 1e3 * cell,
                    100 * std::sqrt(squares), 100 * worst);
        EXPECT_LT(std::sqrt(squares), bar) << cell;
        EXPECT_LT(worst, 1.5 * bar) << cell;
    }
}

// Out of a latewood of three cells and 38 times the stiffness into earlywood: half a cell behind the boundary coarse cells still
// see the tip in both, and hold more than twice the energy of finer ones: without boxes the load that carries the crack on, which
// goes with the root of what is released, would be 40 % off.
TEST(VerificationFineTip, EnergyReleasedBehindAVeryStiffWood) {
    const auto released_from = [](double cell, double from) {
        Scene scene = two_woods(2e-3, from, cell);
        scene.specimen.size = {8e-3, 4e-3};
        scene.specimen.rings = Rings{Vec2(-20e-3, 2e-3), 2.2e-3, 0.25, 0.3e-3};  // latewood up to 2 mm
        scene.materials["LW"].youngs_modulus = 38 * 40e6;
        for (Edge& edge : scene.edges) edge.range = {0.0, 2e-3};
        return released(scene, 0.4e-3)[1];
    };
    for (const double from : {2.1e-3, 2.2e-3}) {
        const double load = std::sqrt(released_from(0.05e-3, from) / released_from(0.2e-3, from));
        std::printf("tip %.1f mm behind stiff wood: load on 0.2 mm cells %+.1f %% of that on 0.05 mm ones\n", 1e3 * from - 2.0,
                    100 * (load - 1));
        EXPECT_NEAR(load, 1.0, 0.1) << from;
    }
}

// Boxes reach up to the grips, which hold their outlines there.
TEST(VerificationFineTip, EnergyReleasedBetweenGrips) {
    const auto released_on = [](double cell) {
        Scene scene = two_woods(2.05e-3, 1.85e-3, cell);
        scene.specimen.size.y() = 1.2e-3;
        for (Vec2& x : scene.cracks[0].points) x.y() = 0.6e-3;
        return released(scene, 0.2e-3);
    };
    const double exact = released_on(0.025e-3)[1];
    const auto [by_grid, all] = released_on(0.1e-3);
    std::printf("grips six cells away: off by %+.1f %%, without fine boxes %+.1f %%\n", 100 * (all / exact - 1),
                100 * (by_grid / exact - 1));
    EXPECT_NEAR(all, exact, 0.03 * exact);
}

// Where whole cells do not fit the specimen, they are oblong, and so are those of the boxes.
TEST(VerificationFineTip, InCellsThatAreNotSquare) {
    const auto released_in = [](double height) {
        Scene scene = two_woods(2.05e-3, 1.85e-3, 0.2e-3);
        scene.specimen.size.y() = height;
        for (Vec2& x : scene.cracks[0].points) x.y() = 0.5 * height;
        // What strip of this height and E' releases far behind the tip, so that heights can be compared.
        return released(scene, 0.4e-3)[1] * height;
    };
    const double square = released_in(4e-3);
    for (const double height : {3.92e-3, 4.08e-3}) {
        const double off = released_in(height) / square - 1;
        std::printf("cells 0.2 x %.3f mm: released %+.1f %% of that in square ones\n", 1e3 * height / 20, 100 * off);
        EXPECT_LT(std::abs(off), 0.05);
    }
}

TEST(VerificationFineTip, CrackJustOffAGridLineIsTheSame) {
    // Both grids cut it where it is, the finer one with a row of points between: together they hold as much energy.
    const AtRest on(two_woods(2.025e-3, 2.05e-3, 0.1e-3));
    Scene scene = on.scene;
    for (Vec2& x : scene.cracks[0].points) x.y() += 8e-6;
    const AtRest off(scene);
    const double missed = missed_by(on).energy, grid_changes = off.equilibrium.potential() - on.equilibrium.potential();
    const double change = grid_changes + missed_by(off).energy - missed;
    std::printf(
        "crack 0.08 cells off a grid line: of the energy missed, the grid's changes by %+.1f %%, with the boxes %+.1f %%\n",
        100 * grid_changes / missed, 100 * change / missed);
    ASSERT_NE(missed, 0.0);
    EXPECT_LT(std::abs(change / missed), 0.03);  // the crack itself has moved by a third of a fine cell
}

TEST(UnitFineTip, NothingIsMissedInOneWood) {
    Scene scene = two_woods(2e-3, 1.5e-3, 0.1e-3);
    EXPECT_EQ(missed_by(AtRest(scene)).energy, 0.0);  // the boundary is five cells away
    scene.cracks[0].points[1].x() = 1.9e-3;
    EXPECT_NE(missed_by(AtRest(scene)).energy, 0.0);
    scene.materials["LW"].youngs_modulus = 60e6;
    EXPECT_EQ(missed_by(AtRest(scene)).energy, 0.0);  // no sharp boundary
}

TEST(UnitFineTip, BoxesKeepClearOfWheels) {
    const AtRest run(two_woods(2.025e-3, 1.97e-3, 0.1e-3));
    const auto top_beside = [&](const Vec2& centre) {
        Scene scene = run.scene;
        Body wheel;
        wheel.shape = Circle{centre, 0.2e-3};
        scene.bodies = {wheel};
        const std::vector<MaterialSlope> none;
        const Vec2 tip = run.equilibrium.cracks().lines[0].end.position;
        const auto boxes = FineTip(scene, run.plan, run.materials, run.body, none).about(run.equilibrium.cracks(), {0, tip, tip});
        return boxes ? boxes->boxes[0].high.y() : 0.0;
    };
    // A tip this near to a boundary calls for 8 cells, up to 2.8 mm; less room makes the box narrower, and then there is none.
    EXPECT_NEAR(top_beside({2e-3, 3.02e-3}), 2.8e-3, 1e-9);
    EXPECT_NEAR(top_beside({2e-3, 2.98e-3}), 2.6e-3, 1e-9);
    EXPECT_NEAR(top_beside({2.95e-3, 2.95e-3}), 2.8e-3, 1e-9);  // beside a corner
    EXPECT_NEAR(top_beside({2.93e-3, 2.93e-3}), 2.6e-3, 1e-9);
    EXPECT_NEAR(top_beside({2e-3, 2.62e-3}), 2.4e-3, 1e-9);
    EXPECT_EQ(top_beside({2e-3, 2.38e-3}), 0.0);
}

TEST(UnitFineTip, BoxesThatTakeACrackAlongAreAsMadeAnew) {
    AtRest run(two_woods(2.025e-3, 1.8e-3, 0.1e-3));
    const std::vector<MaterialSlope> numbers = MaterialSlope::of(run.scene, {"materials.EW.E"}, run.body);
    FineTip kept(run.scene, run.plan, run.materials, run.body, numbers);
    const auto boxes = kept.about(run.equilibrium.cracks(), {0, {1.8e-3, 2e-3}, {2.0e-3, 2e-3}});
    ASSERT_TRUE(boxes);
    for (const Vec2& tip : {Vec2(1.85e-3, 2e-3), Vec2(1.9e-3, 2.005e-3), Vec2(1.95e-3, 2.005e-3), Vec2(2.05e-3, 2.0e-3)}) {
        run.equilibrium.grow(0, true, tip);
        ASSERT_EQ(run.equilibrium.solve(1.0), Equilibrium::Outcome::solved);
        const MissedEnergy one = kept.missed({{*boxes, 0, true}}, run.equilibrium, true)[0];
        FineTip anew(run.scene, run.plan, run.materials, run.body, numbers);
        const MissedEnergy other = anew.missed({{*boxes, 0, true}}, run.equilibrium, true)[0];
        ASSERT_NE(other.energy, 0.0);
        // Of a crack that turns, ties know where it was going when it came: made anew, where it goes.
        EXPECT_NEAR(one.energy, other.energy, 1e-3 * std::abs(other.energy));
        EXPECT_NEAR(one.by_number[0], other.by_number[0], 1e-3 * std::abs(other.by_number[0]));
        // Asked for again, nothing changes.
        EXPECT_NEAR(kept.missed({{*boxes, 0, true}}, run.equilibrium, false)[0].energy, one.energy, 1e-9 * std::abs(one.energy));
    }
}

TEST(UnitCutOut, InTheGridsOwnCellsItsEquilibriumIsTheBoxs) {
    const AtRest run(two_woods(2.025e-3, 1.93e-3, 0.1e-3));
    const CrackFields& cracks = run.equilibrium.cracks();
    const GridView grid{run.body, cracks, run.equilibrium.displacements(), Vec2::Zero(), 0};
    const auto wood = std::make_shared<CutOutWood>(run.scene, run.materials, Box{Vec2(1.2e-3, 1.4e-3), Vec2(2.6e-3, 2.6e-3)},
                                                   Vec2(0.1e-3, 0.1e-3));
    const std::vector<MaterialSlope> numbers;
    CutOut part(run.scene, run.plan, numbers, wood);
    ASSERT_TRUE(part.solve(cracks.lines[0], 0, true, grid, false));
    const double solved = part.potential();
    ASSERT_TRUE(part.solve(cracks.lines[0], 0, true, grid, true));
    EXPECT_NEAR(part.potential(), solved, 1e-9 * solved);
}

// With the specimen's own displacements going along.
void check_slopes(const Scene& scene) {
    const std::vector<std::string> keys{"materials.EW.E", "materials.LW.E", "materials.EW.nu", "materials.LW.nu"};
    AtRest run(scene);
    const std::vector<MaterialSlope> numbers = MaterialSlope::of(scene, keys, run.body);
    const MissedEnergy missed = missed_by(run, numbers);
    ASSERT_NE(missed.energy, 0.0);
    std::vector<Vec2> load = missed.by_displacement;
    for (Vec2& f : load) f *= -1.0;
    const Equilibrium::Motion yielding = run.equilibrium.yield_to(load);
    const Equilibrium::Slopes slopes = run.equilibrium.slopes(numbers);
    for (std::size_t n = 0; n < keys.size(); ++n) {
        const double step = 1e-4 * get_number(scene, keys[n]);
        const auto with = [&](double change) {
            Scene other = scene;
            set_number(other, keys[n], get_number(scene, keys[n]) + change);
            return missed_by(AtRest(other)).energy;
        };
        const double difference = (8.0 * (with(step) - with(-step)) - with(2.0 * step) + with(-2.0 * step)) / (12.0 * step);
        const double slope = missed.by_number[n] + slopes.along(yielding, static_cast<int>(n));
        std::printf("tip %.2f mm, %s: %.6e, difference %.6e\n", 1e3 * scene.cracks[0].points[1].x(), keys[n].c_str(), slope,
                    difference);
        EXPECT_NEAR(slope, difference, 1e-6 * std::abs(difference));
    }
}

TEST(GradientFineTip, SlopesByModuliAgainstCentralDifferences) {
    for (const double tip : {1.93e-3, 2.08e-3}) check_slopes(two_woods(2.025e-3, tip, 0.1e-3));
}

TEST(GradientFineTip, SlopesWhereTheWoodTurns) {
    Scene scene = two_woods(2.025e-3, 1.93e-3, 0.1e-3);
    scene.solver.strain = StrainMeasure::finite_rotation;
    scene.edges[0].velocity = {4e-4, 4e-5};
    check_slopes(scene);
}

// Displacement at which the crack leaves earlywood, through the first latewood, and the most force.
std::pair<double, double> crossing(double cell, bool extrapolate) {
    Scene scene = at_equilibrium(ring_specimen(2.5e-3, cell));
    scene.solver.extrapolate = extrapolate;
    for (auto& [name, wood] : scene.materials) wood.toughness = 10.0;
    scene.cracks[0].grows = Growth::end;
    scene.cracks[0].advance = 0.2e-3;
    scene.cracks[0].direction = GrowthDirection::straight;
    scene.stop.crack_length = 5e-3;
    scene.stop.time.reset();
    const Record record = simulate(scene);
    double most = 0.0;
    for (std::size_t k = 0; k + 1 < record.series.size(); ++k) {
        most = std::max(most, record.series[k].force);
        if (record.series[k + 1].crack_length - record.series[k].crack_length > 0.4e-3)
            return {record.series[k].displacement, most};
    }
    ADD_FAILURE() << "no jump across latewood";
    return {0.0, 0.0};
}

// The load that a crack needs is highest a part of an advance before latewood. Where stations lie must not matter to it: they
// begin with the crack as it is given.
TEST(VerificationStations, PeakOfTheLoadIsFoundBetweenThem) {
    for (const double pith : {-20e-3, 30e-3}) {  // into latewood over its sharp side, either way
        double least = INFINITY, most = 0.0;
        for (const double start : {2.50e-3, 2.52e-3, 2.54e-3, 2.56e-3}) {  // which moves the stations along
            Scene scene = at_equilibrium(ring_specimen(start, 0.1e-3));
            scene.specimen.rings->pith.x() = pith;
            for (auto& [name, wood] : scene.materials) wood.toughness = 10.0;
            scene.cracks[0].grows = Growth::end;
            scene.cracks[0].advance = 0.2e-3;
            scene.cracks[0].direction = GrowthDirection::straight;
            scene.stop.crack_length = 4e-3;
            scene.stop.time.reset();
            double peak = 0.0;
            for (const Instant& row : simulate(scene).series) peak = std::max(peak, row.force);
            std::printf("pith at %.0f mm, crack from %.2f mm: peak %.2f N\n", 1e3 * pith, 1e3 * start, peak);
            least = std::min(least, peak);
            most = std::max(most, peak);
        }
        EXPECT_LT(most, 1.02 * least) << "two stations in an advance scatter by 10 %, four by 5 %";
    }
}

TEST(SlowVerificationFineTip, LoadThatCarriesACrackIntoLatewoodConverges) {
    for (const bool extrapolate : {false, true}) {
        std::vector<std::pair<double, double>> found;
        for (const double cell : {0.2e-3, 0.1e-3, 0.05e-3}) {
            found.push_back(crossing(cell, extrapolate));
            std::printf("sharp rings, %s, %.2f mm cells: crosses at %.5f mm, peak %.2f N\n",
                        extrapolate ? "two grids" : "one grid", 1e3 * cell, 1e3 * found.back().first, found.back().second);
        }
        EXPECT_NEAR(found[1].first, found[2].first, 0.02 * found[2].first);
        EXPECT_NEAR(found[1].second, found[2].second, 0.02 * found[2].second);
        EXPECT_NEAR(found[0].first, found[2].first, 0.05 * found[2].first);
    }
}

}  // namespace
}  // namespace crampfit::test
