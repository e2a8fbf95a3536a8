// Shape functions, wood by place, and the grid's layout.
#include "datasets/error.hpp"
#include "forward/transition_wood.hpp"
#include "tests/forward/scenes.hpp"

#include <Eigen/Eigenvalues>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>
#include <numeric>

namespace crampfit::test {
namespace {

TEST(UnitShapeFunctions, AddUpToOneAndReproduceALine) {
    for (const ShapeFunction kind : {ShapeFunction::linear, ShapeFunction::gimp, ShapeFunction::cpdi}) {
        const Vec2 cell(0.3, 0.2), half(0.075, 0.05), place(0.075, 0.15);
        const CellWeights w = cell_weights(kind, place, cell, half);
        double sum = 0, x = 0, y = 0, slope = 0;
        for (int k = 0; k < 4; ++k) {
            sum += w.value[k];
            x += w.value[k] * (k % 2) * cell.x();
            y += w.value[k] * (k / 2) * cell.y();
            slope += w.slope_x[k] * (k % 2) * cell.x();
        }
        EXPECT_NEAR(sum, 1.0, 1e-14);
        EXPECT_NEAR(x, place.x(), 1e-14);
        EXPECT_NEAR(y, place.y(), 1e-14);
        EXPECT_NEAR(slope, 1.0, 1e-13);
    }
}

TEST(UnitShapeFunctions, SplinesAddUpToOneAndReproduceALineEverywhere) {
    // A line's coefficients are its values at the nodes (Greville), at the ends of the grid too.
    for (const int cells : {1, 2, 5}) {
        for (const int per_side : {1, 2, 3}) {
            Scene scene = block({cells * 0.3, 3 * 0.2}, 0.25);
            scene.model.points_per_cell = per_side * per_side;
            scene.solver.shape_function = ShapeFunction::bspline2;
            const MaterialMap materials(scene);
            const Discretisation body(scene, materials);
            const Layout& layout = body.layout;
            ASSERT_EQ(layout.nodes(), (layout.cells_x + 2) * (layout.cells_y + 2));
            for (int p = 0; p < body.points.count(); ++p) {
                const CellWeights& w = body.weights[body.points.slot[p]];
                double sum = 0;
                Vec2 x = Vec2::Zero();
                Mat2 slope = Mat2::Zero();
                for (int k = 0; k < layout.nodes_per_cell(); ++k) {
                    const Vec2 node = layout.node_position(body.points.node[p][k]);
                    EXPECT_GE(w.value[k], 0.0);
                    EXPECT_TRUE(layout.support(body.points.node[p][k]).contains(body.points.position[p]));
                    sum += w.value[k];
                    x += w.value[k] * node;
                    slope += node * Vec2(w.slope_x[k], w.slope_y[k]).transpose();
                }
                EXPECT_NEAR(sum, 1.0, 1e-14);
                EXPECT_LT((x - body.points.position[p]).norm(), 1e-14);
                EXPECT_LT((slope - Mat2::Identity()).norm(), 1e-12);
            }
        }
    }
}

TEST(UnitShapeFunctions, SplinesAreSmoothFromCellToCell) {
    // Value and slope of the splines that two neighbouring cells share agree at the line between them; also next to the grid's
    // end.
    const double h = 0.3;
    for (const bool first : {false, true}) {
        const auto left = spline_weights(h, h, {first, false});
        const auto right = spline_weights(0.0, h, {false, false});
        EXPECT_NEAR(left[0].value, 0.0, 1e-15);
        EXPECT_NEAR(left[0].slope, 0.0, 1e-14);
        for (int k = 0; k < 2; ++k) {
            EXPECT_NEAR(left[k + 1].value, right[k].value, 1e-15);
            EXPECT_NEAR(left[k + 1].slope, right[k].slope, 1e-14);
        }
    }
    EXPECT_EQ(spline_weights(0.0, h, {true, false})[0].value, 1.0);  // the outermost alone has a value at the end
}

TEST(UnitShapeFunctions, GimpIsTheMeanOfTheHatOverThePointsDomain) {
    const double h = 1.0, half = 0.25;
    for (const double offset : {-1.1, -0.9, -0.1, 0.0, 0.2, 0.6, 1.2}) {
        double value = 0, slope = 0;
        const int n = 20000;
        for (int k = 0; k < n; ++k) {
            const double x = offset - half + 2 * half * (k + 0.5) / n;
            value += linear_weight(x, h).value / n;
            slope += linear_weight(x, h).slope / n;
        }
        EXPECT_NEAR(gimp_weight(offset, h, half).value, value, 1e-4);
        EXPECT_NEAR(gimp_weight(offset, h, half).slope, slope, 2e-4);
    }
}

TEST(UnitLayers, OneWoodComesBackIsotropic) {
    const PlaneElasticity wood{5e7, 2e7};
    LayeredElasticity elasticity = layered(wood);
    for (const double angle : {0.0, 0.4, 1.3}) {
        elasticity.normal = {std::cos(angle), std::sin(angle)};
        Eigen::Matrix3d expected;
        expected << 9e7, 5e7, 0, 5e7, 9e7, 0, 0, 0, 2e7;
        EXPECT_LT((elasticity.stiffness() - expected).norm(), 1e-6 * expected.norm());
    }
}

TEST(UnitLayers, AcrossTheyYieldInTurnAndAlongTogether) {
    // Two woods in equal shares with nu = 0: across, 1/E is the mean of 1/E; along, E is the mean of E.
    LayeredElasticity mean = layered(plane_elasticity(40e6, 0.0, PlaneCondition::strain));
    mean.coefficients = 0.5 * (mean.coefficients + layered(plane_elasticity(1200e6, 0.0, PlaneCondition::strain)).coefficients);
    const Eigen::Matrix3d C = mean.stiffness();
    EXPECT_NEAR(C(0, 0), 2 / (1 / 40e6 + 1 / 1200e6), 1.0);
    EXPECT_NEAR(C(1, 1), 620e6, 1.0);
}

Scene ringed(double transition) {
    Scene scene = ring_specimen(3e-3, 0.1e-3);
    scene.cracks.clear();
    scene.specimen.rings->transition = transition;
    return scene;
}

TEST(UnitRings, LatewoodStandsWhereTheContractPutsIt) {
    const Scene scene = ringed(0.0);
    const MaterialMap map(scene);
    // r / period = 9.5 + ...: at r = 9.6 periods earlywood, at 9.8 latewood.
    EXPECT_EQ(map.at(Vec2(-20e-3 + 9.6 * 2.2e-3, 5e-3)).latewood, 0.0);
    EXPECT_EQ(map.at(Vec2(-20e-3 + 9.8 * 2.2e-3, 5e-3)).latewood, 1.0);
}

TEST(UnitRings, TransitionFollowsTheDensity) {
    const Scene scene = ringed(0.44e-3);
    const MaterialMap map(scene);
    const double middle = -20e-3 + (9.75 - 0.1) * 2.2e-3;  // half way through a transition of 0.2 periods
    const LocalWood wood = map.at(Vec2(middle, 5e-3));
    EXPECT_NEAR(wood.density, 0.5 * (300 + 9000), 1.0);
    const double power = std::log(30.0) / std::log(30.0);  // E and density both go up 30 times here
    EXPECT_NEAR(wood.plane_modulus() * (1 - 0.33 * 0.33), 40e6 * std::pow(4650.0 / 300.0, power), 1e3);
}

TEST(UnitRings, BandsKeepTheirWidthOnAnyGrid) {
    // The share of latewood among the points is that of the area, not rounded to points.
    double share[2];
    for (const int k : {0, 1}) {
        Scene scene = ringed(0.0);
        scene.model.cell = k == 0 ? 0.5e-3 : 0.05e-3;
        const MaterialMap map(scene);
        const Discretisation body(scene, map);
        share[k] = std::accumulate(body.points.latewood.begin(), body.points.latewood.end(), 0.0) / body.points.count();
    }
    EXPECT_NEAR(share[0], share[1], 0.003);
}

TEST(UnitRings, BandsAlongTheGridKeepTheirShareWhereverTheyLie) {
    // Bands of 2.6 cells whose period is ten: each lies in the same place of its cells.
    for (const double offset : {0.0, 0.03e-3, 0.07e-3, 0.11e-3, 0.16e-3}) {
        Scene scene = ringed(0.0);
        const double far = 1e3;
        scene.model.cell = 0.2e-3;
        scene.specimen.rings = Rings{Vec2(-far + offset, 5e-3), 2e-3, 0.26, 0.0};
        const MaterialMap map(scene);
        const Discretisation body(scene, map);
        const double share = std::accumulate(body.points.latewood.begin(), body.points.latewood.end(), 0.0) / body.points.count();
        EXPECT_NEAR(share, 0.26, 0.26 * 0.01) << offset;
    }
}

TEST(UnitLayout, FitsTheSpecimenAndLeavesOutCutouts) {
    Scene scene = block({10e-3, 5e-3}, 0.12e-3);
    scene.specimen.cutouts = {Circle{Vec2(5e-3, 2.5e-3), 1e-3}};
    const MaterialMap map(scene);
    const Discretisation body(scene, map);
    EXPECT_NEAR(body.layout.size().x(), 10e-3, 1e-15);
    EXPECT_NEAR(body.layout.size().y(), 5e-3, 1e-15);
    double area = 0;
    for (int p = 0; p < body.points.count(); ++p) {
        EXPECT_GT((body.points.position[p] - Vec2(5e-3, 2.5e-3)).norm(), 1e-3);
        area += body.points.volume[p];
    }
    EXPECT_NEAR(area, 50e-6 - M_PI * 1e-6, 0.05e-6);
    double outline = 0;  // of the cutout: its facets lie on the circle and add up to its length
    for (const Facet& facet : body.facets) {
        const double r = (facet.position - Vec2(5e-3, 2.5e-3)).norm();
        if (r > 1.2e-3) continue;
        EXPECT_NEAR(r, 1e-3, 1e-9);
        outline += facet.length;
    }
    EXPECT_NEAR(outline, 2 * M_PI * 1e-3, 0.3e-3);
}

// A picture of 1 mm x 1 mm in two woods without Poisson's effect, latewood where `is_late` says so.
template <class IsLate>
Scene two_woods(int pixels, const IsLate& is_late) {
    Scene scene = block({1e-3, 1e-3}, 0.1e-3);
    scene.model.plane = PlaneCondition::stress;
    scene.materials["EW"].poisson_ratio = 0.0;
    scene.materials["LW"] = {1200e6, 0.0, 900.0, 100.0};
    Specimen map;
    map.columns = map.rows = pixels;
    map.pixel = 1e-3 / pixels;
    map.classes = {"EW", "LW"};
    for (int row = 0; row < pixels; ++row)
        for (int column = 0; column < pixels; ++column)
            map.label.push_back(is_late(map.pixel * Vec2(column + 0.5, pixels - row - 0.5)));
    scene.specimen.map = std::make_shared<Specimen>(map);
    scene.specimen.material.clear();
    return scene;
}

TEST(UnitWood, LayersLieAsTheEdgeInThePicture) {
    // Where steps of the edge lie farther apart than the 8 + 2 * 7 pixels that are looked at, no more can be known than that it
    // is straight.
    const double least_told = std::atan(1.0 / 22.0) * 180 / M_PI;
    double worst = 0, sum = 0;
    int count = 0;
    for (double degrees = 0; degrees < 90; degrees += 2.5) {
        const double angle = degrees * M_PI / 180;
        const Vec2 normal(std::cos(angle), std::sin(angle));
        const Scene scene = two_woods(80, [&](const Vec2& x) { return normal.dot(x - Vec2(0.5e-3, 0.5e-3)) > 0.0; });
        const MaterialMap materials(scene);
        const Vec2 found = materials.average(Vec2(0.51e-3, 0.49e-3), Vec2(0.05e-3, 0.05e-3)).elasticity.normal;
        const double off = std::asin(std::abs(cross(normal, found))) * 180 / M_PI;
        worst = std::max(worst, off);
        sum += off;
        ++count;
    }
    std::printf("normal of an edge in a picture, cells of 8 pixels: within %.2f degrees, %.2f on average\n", worst, sum / count);
    EXPECT_LT(worst, least_told);
    EXPECT_LT(sum / count, 1.0);  // as asked of orientations
}

// A slot right through carries load where wood on both sides has nodes in common, and only there is it told of. Cells of 0.1 mm
// with two points a side, of which the slot takes all or a part.
TEST(UnitWood, AVoidThatTheGridBridgesIsToldOf) {
    int bridged = 0, parted = 0;
    for (const double width : {0.06e-3, 0.12e-3, 0.16e-3, 0.2e-3, 0.26e-3})
        for (int k = 0; k < 4; ++k) {
            const double low = 0.4e-3 + k * 0.025e-3 + 0.001e-3, high = low + width;
            Scene scene = block({1e-3, 1e-3}, 0.1e-3);
            scene.specimen.cutouts = {Polygon{{Vec2(-1e-3, low), Vec2(2e-3, low), Vec2(2e-3, high), Vec2(-1e-3, high)}}};
            scene.edges = {{"top", Side::top, {}, {0.0, 1e-6}, {}, {}}, {"bottom", Side::bottom, {}, {0.0, 0.0}, {}, {}}};
            scene.measure = {"top", "top"};
            scene.stop.displacement = 1e-6;
            const Record record = simulate(scene);
            const bool told = record.message.find("thin voids: bridged at") != std::string::npos;
            EXPECT_EQ(told, std::abs(record.series.back().force) > 1e-9) << width << " " << low << ": " << record.message;
            (told ? bridged : parted)++;
        }
    EXPECT_GE(bridged, 5);
    EXPECT_GE(parted, 5);
}

// Of 1 mm x 1 mm the picture covers nine tenths, all, nothing.
TEST(UnitWood, APictureBesideTheSpecimenIsToldOf) {
    Scene scene = two_woods(20, [](const Vec2& x) { return x.x() > 0.5e-3; });
    scene.edges = {{"top", Side::top, {}, {0.0, 1e-6}, {}, {}}, {"bottom", Side::bottom, {}, {0.0, 0.0}, {}, {}}};
    scene.measure = {"top", "top"};
    scene.stop.displacement = 1e-6;
    const auto told = [&](double offset) {
        scene.specimen.file_offset = {offset, 0.0};
        const MaterialMap materials(scene);
        const Discretisation body(scene, materials);
        std::string text;
        for (const Plan::Choice& choice : make_plan(scene, materials, body).choices)
            if (choice.part == "wood not seen") text = choice.choice;
        return text;
    };
    EXPECT_EQ(told(0.0), "");
    EXPECT_EQ(told(0.04e-3), "");  // less than a pixel: rounding
    EXPECT_EQ(told(0.15e-3), "10 % of the specimen");
    EXPECT_THROW(told(1.2e-3), InputError);
}

// The map's transition wood comes from a table: against the laws themselves, moduli 1000 apart.
TEST(UnitWood, TransitionWoodFollowsItsLaws) {
    Scene scene = block({2e-3, 2e-3}, 1e-3);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(-1e-3, 1e-3), 4e-3, 0.25, 1.5e-3};  // transition wood from 0.5 to 2 mm
    scene.materials["EW"] = {40e6, 0.33, 300.0, 100.0};
    scene.materials["LW"] = {40e9, 0.3, 750.0, 250.0};
    const MaterialMap materials(scene);
    double worst = 0.0;
    for (int k = 1; k < 1000; ++k) {
        const double grade = k / 1000.0;
        const LocalWood found = materials.at(Vec2(0.5e-3 + grade * 1.5e-3, 1e-3));
        const Material law = transition_wood(scene.materials.at("EW"), scene.materials.at("LW"), {}, grade);
        const double modulus =
            layered(plane_elasticity(law.youngs_modulus, law.poisson_ratio, scene.model.plane)).coefficients[0];
        worst = std::max({worst, std::abs(found.plane_modulus() / modulus - 1), std::abs(found.toughness / law.toughness - 1),
                          std::abs(found.density / law.density - 1)});
    }
    std::printf("transition wood, moduli 1000 apart: within %.1e of its laws\n", worst);
    EXPECT_LT(worst, 1e-9);  // of a place in the ring, rounding leaves 1e-12
}

TEST(UnitWood, KnowsWhereInACellEachWoodLies) {
    // Latewood in the right quarter of a cell, h wide and high: strain along the boundary feels the moments of E, of 16 samples a
    // side.
    const double h = 1e-3, spread = 0.9, E1 = 40e6, E2 = 1200e6;
    const Scene scene = two_woods(8, [&](const Vec2& x) { return x.x() > 0.75 * h; });
    const MaterialMap materials(scene);
    const Vec2 middle(0.5 * h, 0.5 * h);
    WoodArea cell{middle, middle};
    const LocalWood average = materials.average(cell);
    const Unevenness wood = materials.unevenness(cell, average, {spread, spread});
    const double in_quarter = h * h * (9.0 / 64 + (1 - 1 / 16.0) / 192), in_all = h * h / 12 * (1 - 1 / 256.0);  // means of x^2
    Eigen::Matrix<double, 3, 2> coupling = Eigen::Matrix<double, 3, 2>::Zero();
    coupling(1, 1) = (E2 - E1) / 4 * spread * 3 * h / 8;
    Eigen::Matrix2d bending = Eigen::Matrix2d::Zero();
    bending(1, 1) = (E2 - E1) / 4 * spread * spread * (in_quarter - in_all);
    EXPECT_LT((wood.coupling - coupling).norm(), 1e-9 * coupling.norm());
    EXPECT_LT((wood.bending - bending).norm(), 1e-9 * bending.norm());
    EXPECT_TRUE(wood.stretch.isZero(0.0));
    // Of the cell's left half: what earlywood is short of the average.
    WoodArea left_half{{0.25 * h, 0.5 * h}, {0.25 * h, 0.5 * h}};
    const Unevenness left = materials.unevenness(left_half, average, {0.0, 0.0});
    const Eigen::Matrix3d early =
        plane_stiffness(scene.materials.at("EW"), PlaneCondition::stress) - average.elasticity.stiffness();
    EXPECT_LT((left.stretch - early).norm(), 1e-12 * early.norm());
    EXPECT_TRUE(left.coupling.isZero(1e-12 * coupling.norm()) && left.bending.isZero(0.0));
    // The whole cell, whose sides are free to curve: along the boundary that changes nothing.
    const Unevenness whole = materials.unevenness(cell, average, {1.0, 1.0});
    EXPECT_LT((spread * whole.coupling - coupling).norm(), 1e-9 * coupling.norm());
    EXPECT_LT((spread * spread * whole.bending - bending).norm(), 1e-9 * bending.norm());
}

// Parts of a specimen share what their cells hold. Each counts places from its own corner, with its own rounding.
TEST(UnitWood, PartsShareTheSameBitsWhicheverComesFirst) {
    const Scene scene = ringed(0.44e-3);
    const double cell = 1e-3 / 15.0;
    std::array<std::vector<LocalWood>, 2> found;
    std::array<std::vector<Unevenness>, 2> uneven;
    int mixed = 0;
    for (const bool other_first : {false, true}) {
        const MaterialMap materials(scene);
        for (int i = 5; i < 60; ++i)
            for (int j = 5; j < 15; ++j)
                for (const bool second : {false, true}) {
                    const int corner = second == other_first ? 3 : 2;
                    const MaterialMap part = materials.part(Vec2::Constant(corner * cell));
                    WoodArea area{cell * Vec2(i + 0.5 - corner, j + 0.5 - corner), Vec2::Constant(0.5 * cell)};
                    const LocalWood wood = part.average(area);
                    const Unevenness unevenness = part.unevenness(area, wood, {0.9, 0.9});
                    if (second) continue;
                    found[other_first].push_back(wood);
                    uneven[other_first].push_back(unevenness);
                    mixed += wood.mixed;
                }
    }
    ASSERT_GT(mixed, 10);
    for (std::size_t k = 0; k < found[0].size(); ++k) {
        EXPECT_EQ(found[0][k].elasticity.coefficients, found[1][k].elasticity.coefficients);
        EXPECT_EQ(found[0][k].toughness, found[1][k].toughness);
        EXPECT_EQ(uneven[0][k].coupling, uneven[1][k].coupling);
        EXPECT_EQ(uneven[0][k].bending, uneven[1][k].bending);
    }
}

// Whatever strain and bending e, q there are in a whole cell, its energy e . S e / 2 + e . G q + q . H q / 2 is positive: of the
// size that it would have if the wood were as soft as the softer one everywhere.
TEST(UnitWood, AWholeCellOfTwoWoodsResistsAllItsMotions) {
    const double h = 0.1e-3, E1 = 40e6;
    for (const double contrast : {3.0, 30.0, 1000.0}) {
        double least = INFINITY;
        for (int turn = 0; turn < 36; ++turn) {
            for (const double offset : {-0.5, -0.3, -0.1, 0.0, 0.2, 0.4}) {
                const double angle = turn * M_PI / 18;
                const Vec2 normal(std::cos(angle), std::sin(angle)), middle(0.45e-3, 0.55e-3);
                Scene scene = two_woods(80, [&](const Vec2& x) { return normal.dot(x - middle) > offset * h; });
                scene.materials["EW"].poisson_ratio = scene.materials["LW"].poisson_ratio = 0.33;
                scene.materials["LW"].youngs_modulus = contrast * E1;
                const MaterialMap materials(scene);
                WoodArea cell{middle, Vec2::Constant(0.5 * h)};
                const LocalWood average = materials.average(cell);
                const Unevenness wood = materials.unevenness(cell, average, {1.0, 1.0});
                const Eigen::Matrix3d S = average.elasticity.stiffness();
                const Eigen::Matrix2d free_sides = h * h / 12 * uniaxial_moduli(S).asDiagonal();
                Eigen::Matrix<double, 5, 5> energy, soft = Eigen::Matrix<double, 5, 5>::Zero();
                energy << S, wood.coupling / h, wood.coupling.transpose() / h, (free_sides + wood.bending) / (h * h);
                soft.topLeftCorner<3, 3>() = plane_stiffness(scene.materials.at("EW"), PlaneCondition::stress);
                soft.bottomRightCorner<2, 2>() = E1 / 12 * Eigen::Matrix2d::Identity();
                const Eigen::GeneralizedSelfAdjointEigenSolver<Eigen::Matrix<double, 5, 5>> against(energy, soft);
                least = std::min(least, against.eigenvalues()[0]);
            }
        }
        std::printf("whole cells of two woods %4.0f apart: the softest motion meets %.3f of what it does in the softer wood\n",
                    contrast, least);
        EXPECT_GT(least, 0.5);  // above 0 it must be; strains of the cell's own may take a little of it
    }
}

}  // namespace
}  // namespace crampfit::test
