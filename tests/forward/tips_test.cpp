// K_I, K_II and G at crack tips, and the directions in which cracks grow, against exact and handbook values. All at equilibrium,
// with two points along each side of a cell.
#include "benchmarks/reference_problems.hpp"
#include "forward/growth.hpp"
#include "forward/near_tip_field.hpp"
#include "forward/simulate.hpp"
#include "tests/forward/cracked_plates.hpp"
#include "tests/forward/laminated_strip.hpp"

#include <Eigen/LU>
#include <Eigen/QR>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

namespace crampfit::test {
namespace {

// --- The near-tip field

// Plane compliance of isotropic wood in plane stress, and of wood whose axes are turned against the crack.
std::array<Eigen::Matrix3d, 3> compliances() {
    Eigen::Matrix3d isotropic, wood;
    isotropic << 1, -0.4, 0, -0.4, 1, 0, 0, 0, 2.8;
    wood << 1, -0.6, 0, -0.6, 15, 0, 0, 0, 40;
    isotropic /= 50e6;
    wood /= 700e6;
    const auto turned = [&](double angle) {
        return Eigen::Matrix3d(from_axes(wood.inverse(), Vec2(std::cos(angle), std::sin(angle))).inverse());
    };
    return {isotropic, turned(0.0), turned(0.7)};
}

TEST(UnitNearTipField, IsElasticBalancedAndFreeOnTheFaces) {
    const double r = 2e-3, step = 1e-7, scale = 1.0 / std::sqrt(2 * std::numbers::pi * r);  // of the stress
    for (const Eigen::Matrix3d& compliance : compliances()) {
        const NearTipField field(compliance);
        for (const int mode : {0, 1}) {
            for (const double angle : {-2.5, -0.7, 0.0, 1.1, 3.0, 3.3, -3.5}) {
                const NearTipField::Mode here = field.at(r, angle)[mode];
                const Mat2& g = here.gradient;
                const Eigen::Vector3d strain(g(0, 0), g(1, 1), g(0, 1) + g(1, 0));
                EXPECT_LT((strain - field.strain(here.stress)).norm(), 1e-12 * scale * compliance.norm());
                const Vec2 x(r * std::cos(angle), r * std::sin(angle));
                const auto beside = [&](int axis, double way) {
                    Vec2 there = x;
                    there[axis] += way;
                    const double turn = std::atan2(cross(x, there), x.dot(there));
                    return field.at(there.norm(), angle + turn)[mode];
                };
                for (int k = 0; k < 2; ++k) {
                    const Mat2 slope = (beside(k, step).stress - beside(k, -step).stress) / (2 * step);
                    EXPECT_LT((slope - here.stress_slope[k]).norm(), 1e-6 * here.stress_slope[k].norm());
                }
                // Compatible: the gradient is that of a displacement.
                const Mat2 by_x = (beside(0, step).gradient - beside(0, -step).gradient) / (2 * step);
                const Mat2 by_y = (beside(1, step).gradient - beside(1, -step).gradient) / (2 * step);
                EXPECT_LT((by_x.col(1) - by_y.col(0)).norm(), 1e-6 * by_x.norm());
                const Vec2 balance = here.stress_slope[0].col(0) + here.stress_slope[1].col(1);
                EXPECT_LT(balance.norm(), 1e-12 * here.stress_slope[0].norm());
            }
            for (const double face : {-1.0, 1.0})
                EXPECT_LT((field.at(r, face * std::numbers::pi)[mode].stress * Vec2(0, 1)).norm(), 1e-12 * scale);
            // Ahead of the tip s_yy = K_I / (2 pi r)^1/2 and s_xy = K_II / (2 pi r)^1/2: what K means.
            const Mat2 ahead = field.at(r, 0.0)[mode].stress;
            EXPECT_NEAR(ahead(1, 1), (1 - mode) * scale, 1e-12 * scale);
            EXPECT_NEAR(ahead(0, 1), mode * scale, 1e-12 * scale);
        }
    }
}

TEST(UnitNearTipField, IsWilliamsFieldInIsotropicWood) {
    // Williams 1957, first term: s_xx, s_yy, s_xy of mode I and mode II.
    const NearTipField field(compliances()[0]);
    for (const double t : {-3.0, -1.0, 0.2, 2.0}) {
        const double c = std::cos(t / 2), s = std::sin(t / 2), c3 = std::cos(1.5 * t), s3 = std::sin(1.5 * t);
        Mat2 one, two;
        one << c * (1 - s * s3), c * s * c3, c * s * c3, c * (1 + s * s3);
        two << -s * (2 + c * c3), c * (1 - s * s3), c * (1 - s * s3), s * c * c3;
        const auto modes = field.at(1.0 / (2 * std::numbers::pi), t);
        EXPECT_LT((modes[0].stress - one).norm(), 1e-12);
        EXPECT_LT((modes[1].stress - two).norm(), 1e-12);
    }
    EXPECT_LT((field.release() - Mat2::Identity() / 50e6).norm(), 1e-13 / 50e6);
}

TEST(UnitNearTipField, ReleasesTheWorkOfClosingTheCrack) {
    // Irwin 1957: G is half the mean of the stress ahead on what the faces open by behind, over a short advance d:
    // with s(r) = s(1) r^-1/2 and u(r) = u(1) r^1/2 the mean over d of s(r) u(d - r) is pi / 2 s(1) u(1).
    for (const Eigen::Matrix3d& compliance : compliances()) {
        const NearTipField field(compliance);
        const auto ahead = field.at(1.0, 0.0), upper = field.at(1.0, std::numbers::pi), lower = field.at(1.0, -std::numbers::pi);
        Mat2 H;
        for (int i = 0; i < 2; ++i) {
            for (int j = 0; j < 2; ++j) {
                // u = r^1/2 u(1) and du / dx = -u(1) / 2 on the faces.
                const Vec2 opening = -2.0 * (upper[j].gradient.col(0) - lower[j].gradient.col(0));
                H(i, j) = 0.5 * 0.5 * std::numbers::pi * ahead[i].stress.col(1).dot(opening);
            }
        }
        EXPECT_LT((0.5 * (H + H.transpose()) - field.release()).norm(), 1e-12 * H.norm());
    }
}

// --- Directions

TEST(UnitHoopStress, TurnsAsErdoganAndSihSay) {
    EXPECT_EQ(hoop_stress_angle(1.0, 0.0), 0.0);
    EXPECT_EQ(hoop_stress_angle(0.0, 0.0), 0.0);
    EXPECT_NEAR(hoop_stress_angle(0.0, 1.0) / degree, -70.5288, 1e-3);  // cos t = 1/3
    EXPECT_NEAR(hoop_stress_angle(0.0, -1.0) / degree, 70.5288, 1e-3);
    // Slanted centre crack (REFERENCES).
    for (const auto& [slant, kink] : {std::pair{15.0, -26.74}, {30.0, -43.22}, {45.0, -53.13}, {60.0, -60.00}}) {
        const double b = slant * degree;
        EXPECT_NEAR(hoop_stress_angle(std::cos(b) * std::cos(b), std::sin(b) * std::cos(b)) / degree, kink, 0.006);
    }
    for (const double K_II : {0.01, 0.3, 2.0, -1.0}) {
        // The shear stress vanishes there and the hoop stress is a maximum: seen in the near-tip field itself.
        const double angle = hoop_stress_angle(1.0, K_II);
        const NearTipField field(compliances()[0]);
        const auto stress = [&](double t) {
            const auto modes = field.at(1.0, t);
            return Mat2(modes[0].stress + K_II * modes[1].stress);
        };
        const auto hoop = [&](double t) {
            const Vec2 across(-std::sin(t), std::cos(t));
            return across.dot(stress(t) * across);
        };
        const Vec2 across(-std::sin(angle), std::cos(angle)), out(std::cos(angle), std::sin(angle));
        EXPECT_NEAR(across.dot(stress(angle) * out), 0.0, 1e-12);
        for (const double other : {-1.0, -0.1, 0.1, 1.0}) EXPECT_GT(hoop(angle), hoop(angle + other));
    }
}

TEST(UnitBranch, StartsAsCotterellAndRiceSay) {
    // Cotterell and Rice 1980, eq. 33: exact to the first order of the angle, C_11 to the second.
    for (const double t : {-0.02, 0.02}) {
        const Vec2 one = branch_intensities(t, 1.0, 0.0), two = branch_intensities(t, 0.0, 1.0);
        const double s = 0.5 * t;
        EXPECT_NEAR(one[0], 0.25 * (3 * std::cos(s) + std::cos(3 * s)), 1e-6);
        EXPECT_NEAR(one[1], 0.25 * (std::sin(s) + std::sin(3 * s)), 1e-5);
        EXPECT_NEAR(two[0], -0.75 * (std::sin(s) + std::sin(3 * s)), 1e-5);
        EXPECT_NEAR(two[1], 0.25 * (std::cos(s) + 3 * std::cos(3 * s)), 1e-3);
    }
}

// The way in which a tip in the middle of a 10 mm block turns, in degrees; `side` sets the toughness above the tip over that
// below.
double turn(GrowthDirection criterion, double K_I, double K_II, double side = 1.0, Vec2 ahead = {1.0, 0.0}) {
    Scene scene = block({10e-3, 10e-3}, 1e-3);
    if (side != 1.0) {
        // A ring's boundary runs along the crack, a micrometre above it: earlywood below, latewood above.
        scene.specimen.material.clear();
        scene.specimen.rings = Rings{Vec2(5e-3, 5.001e-3 - 100.0), 200.0, 0.5, 0.0};
        scene.materials["LW"] = {40e6, 0.33, 400.0, side * earlywood().toughness};
    }
    const MaterialMap materials(scene);
    CrackTip tip;
    tip.position = {5e-3, 5e-3};
    tip.direction = ahead;
    TipLoad load;
    load.K_I = K_I;
    load.K_II = K_II;
    load.toughness = earlywood().toughness;
    const Vec2 way = growth_direction(criterion, tip, load, materials, 0.5e-3);
    EXPECT_NEAR(way.norm(), 1.0, 1e-12);
    return std::atan2(cross(ahead, way), ahead.dot(way)) / degree;
}

TEST(UnitGrowthDirection, CountsFromTheCrackAhead) {
    for (const Vec2& ahead : {Vec2(1, 0), Vec2(-1, 0), Vec2(0.6, -0.8)}) {
        EXPECT_NEAR(turn(GrowthDirection::hoop_stress, 1.0, 1.0, 1.0, ahead), -53.13, 0.01);
        EXPECT_NEAR(turn(GrowthDirection::energy_release_rate, 1.0, 0.0, 1.0, ahead), 0.0, 1e-6);
        EXPECT_NEAR(turn(GrowthDirection::straight, 1.0, 1.0, 1.0, ahead), 0.0, 1e-9);
    }
}

// By the hoop stress under K_I = K_II, `distance` from wood `ratio` times as stiff [degrees]; it asks for 53 degrees.
double turn_beside(double distance, double ratio, const Vec2& ahead) {
    Scene scene = block({10e-3, 10e-3}, 1e-3);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(5e-3 - 100.0, 5e-3), 200.0, 0.5, 0.0};  // boundary at x = 5 mm
    scene.materials["LW"] = {ratio * 40e6, 0.33, 400.0, earlywood().toughness};
    CrackTip tip;
    tip.position = {5e-3 - distance, 5e-3};
    tip.direction = ahead;
    TipLoad load;
    load.K_I = load.K_II = 1.0;
    const Vec2 way = growth_direction(GrowthDirection::hoop_stress, tip, load, MaterialMap(scene), 0.5e-3);
    return std::atan2(cross(ahead, way), ahead.dot(way)) / degree;
}

// A tip in stiff or soft wood heeds K only so far from a boundary, across its way or along it.
TEST(UnitGrowthDirection, NearBoundariesTheWayIsStraight) {
    for (const Vec2& ahead : {Vec2(1, 0), Vec2(0, 1)}) {
        for (const double side : {1.0, -1.0}) {
            for (const double near : {0.1e-3, 0.37e-3}) EXPECT_NEAR(turn_beside(side * near, 10.0, ahead), 0.0, 0.01) << near;
            EXPECT_NEAR(turn_beside(side * 0.63e-3, 10.0, ahead), -53.13, 0.01);
            EXPECT_NEAR(turn_beside(side * 0.1e-3, 1.4, ahead), -53.13, 0.01);
        }
    }
}

// Else a fit would see paths jump, as a modulus changes or a tip passes.
TEST(UnitGrowthDirection, NeitherStiffnessNorDistanceMakesTheWayJump) {
    for (const Vec2& ahead : {Vec2(1, 0), Vec2(0, 1)}) {
        for (int i = 0; i < 200; ++i) {
            const double ratio = std::pow(1.01, i);
            EXPECT_NEAR(turn_beside(0.3e-3, 1.01 * ratio, ahead), turn_beside(0.3e-3, ratio, ahead), 2.0) << ratio;
            const double distance = 0.3e-3 + i * 2e-6;
            EXPECT_NEAR(turn_beside(distance + 2e-6, 10.0, ahead), turn_beside(distance, 10.0, ahead), 1.0) << distance;
        }
    }
}

TEST(UnitGrowthDirection, RoundingTurnsNoCrack) {
    const MaterialMap materials(block({10e-3, 10e-3}, 1e-3));
    CrackTip tip;
    tip.position = {5e-3, 5e-3};
    tip.direction = {1.0, 0.0};
    TipLoad load;
    load.K_I = std::numeric_limits<double>::quiet_NaN();
    load.opening = {1e-12, 1.0};
    EXPECT_EQ(growth_direction(GrowthDirection::normal_to_opening, tip, load, materials, 1e-3), tip.direction);
    load.opening = {1e-5, 1.0};
    EXPECT_NE(growth_direction(GrowthDirection::normal_to_opening, tip, load, materials, 1e-3), tip.direction);
}

// K_I = K_II ask for a turn by 45 degrees, the opening that is seen for none.
TEST(UnitGrowthDirection, TheOpeningIsToldByKAwayFromBoundariesAndSeenBesideThem) {
    Scene scene = block({10e-3, 10e-3}, 1e-3);
    scene.specimen.material.clear();
    scene.specimen.rings = Rings{Vec2(5e-3 - 100.0, 5e-3), 200.0, 0.5, 0.0};  // boundary at x = 5 mm
    scene.materials["LW"] = {400e6, 0.33, 400.0, earlywood().toughness};
    const MaterialMap materials(scene);
    for (const auto& [x, asked] :
         {std::pair{4.4e-3, -45.0}, {4.6249e-3, -22.5}, {4.9e-3, 0.0}, {5.1e-3, 0.0}, {5.3751e-3, -22.5}}) {
        for (const Vec2& ahead : {Vec2(1, 0), Vec2(-1, 0), Vec2(0, 1)}) {
            CrackTip tip;
            tip.position = {x, 5e-3};
            tip.direction = ahead;
            TipLoad load;
            load.opening = left_of(ahead);
            load.K_I = load.K_II = 1.0;
            const auto turned = [&] {
                const Vec2 way = growth_direction(GrowthDirection::normal_to_opening, tip, load, materials, 0.5e-3);
                return std::atan2(cross(ahead, way), ahead.dot(way)) / degree;
            };
            EXPECT_NEAR(turned(), asked, 0.05) << x;
            load.K_I = std::numeric_limits<double>::quiet_NaN();
            EXPECT_EQ(turned(), 0.0) << x;
        }
    }
}

TEST(UnitGrowthDirection, LargestEnergyReleaseIsNearLargestHoopStressInOneWood) {
    // Amestoy and Leblond 1992: the two criteria differ by less than a degree for K_II < K_I / 4 and by 5 degrees in pure shear.
    for (const auto& [K_II, apart] : {std::pair{0.05, 0.1}, {0.25, 1.0}, {1.0, 4.0}, {1e6, 5.5}}) {
        for (const double sense : {1.0, -1.0}) {
            const double hoop = turn(GrowthDirection::hoop_stress, 1.0, sense * K_II);
            const double energy = turn(GrowthDirection::energy_release_rate, 1.0, sense * K_II);
            std::printf("K_II/K_I = %+g: hoop stress %+.2f deg, energy release rate %+.2f deg\n", sense * K_II, hoop, energy);
            EXPECT_NEAR(energy, hoop, apart);
        }
    }
}

TEST(UnitGrowthDirection, TougherWoodOnOneSideKeepsTheCrackOff) {
    // K_II < 0 drives the crack up. Tougher wood there holds it back to the boundary; weaker wood lets it pass.
    EXPECT_GT(turn(GrowthDirection::energy_release_rate, 1.0, -0.5, 0.5), 30.0);
    EXPECT_LE(turn(GrowthDirection::energy_release_rate, 1.0, -0.5, 4.0), 0.0);
    EXPECT_GT(turn(GrowthDirection::hoop_stress, 1.0, -0.5, 4.0), 30.0);  // which knows nothing of toughness
    // Half the toughness on one side draws a crack in pure mode I there; twice the toughness leaves it straight.
    EXPECT_GT(turn(GrowthDirection::energy_release_rate, 1.0, 0.0, 0.5), 0.5);
    EXPECT_NEAR(turn(GrowthDirection::energy_release_rate, 1.0, 0.0, 2.0), 0.0, 1e-9);
}

// --- Stress intensity

TEST(VerificationSlantedCrack, KAndFirstKink) {
    // Infinite plate under tension along y, 10 cells per half crack. Asked: 2 % of K0 and 1.5 degrees, at both ends.
    const double stress = 1e5;
    SlantedCrack plate;
    plate.remote(1, 1) = stress;
    plate.offset = {0.13, 0.27};
    const double K0 = stress * std::sqrt(std::numbers::pi * plate.half_length);
    for (const double slant : {15.0, 30.0, 45.0, 60.0}) {
        plate.angle = slant * degree;
        const double K_I = K0 * std::cos(plate.angle) * std::cos(plate.angle);
        const double K_II = K0 * std::sin(plate.angle) * std::cos(plate.angle);
        const AtRest run(slanted_crack(plate));
        ASSERT_TRUE(run.solved());
        for (const bool at_end : {true, false}) {
            const TipLoad load = run.load(at_end);
            const double kink = (hoop_stress_angle(load.K_I, load.K_II) - hoop_stress_angle(K_I, K_II)) / degree;
            std::printf("slanted crack, %2.0f deg, %s: K_I off by %+.2f %%, K_II by %+.2f %% of K0, kink by %+.2f deg\n", slant,
                        at_end ? "end  " : "start", 100 * (load.K_I - K_I) / K0, 100 * (load.K_II - K_II) / K0, kink);
            EXPECT_NEAR(load.K_I, K_I, 0.02 * K0);
            EXPECT_NEAR(load.K_II, K_II, 0.02 * K0);
            EXPECT_LT(std::abs(kink), 1.5);
        }
    }
}

// The normal to the opening of a slanted crack lies across the tension, wherever its tip lies in a cell.
TEST(VerificationSlantedCrack, NormalToItsOpening) {
    SlantedCrack plate;
    plate.remote(1, 1) = 1e5;
    for (const double slant : {15.0, 30.0, 45.0, 60.0}) {
        plate.angle = slant * degree;
        double worst = 0.0;
        for (int k = 0; k < 8; ++k) {
            plate.offset = {0.13 + 0.125 * k, 0.27 + 0.375 * k};
            const AtRest run(slanted_crack(plate));
            ASSERT_TRUE(run.solved());
            for (const bool at_end : {true, false}) {
                const CrackTip& tip = run.equilibrium.cracks().lines[0].tip(at_end);
                const Vec2 way = growth_direction(GrowthDirection::normal_to_opening, tip, run.load(at_end), run.materials,
                                                  run.body.layout.cell.maxCoeff());
                worst = std::max(worst, std::abs(std::atan(way.y() / way.x())) / degree);
            }
        }
        std::printf("slanted crack, %2.0f deg: normal to its opening up to %.2f deg off\n", slant, worst);
        EXPECT_LT(worst, 1.0);
    }
}

// Worst errors in mode I over places of the crack in its cell, `places` each way, at one angle to the grid.
void check_turned_crack(double angle, int places) {
    const double stress = 1e5;
    SlantedCrack plate;
    plate.angle = angle * degree;
    const Vec2 normal(-std::sin(plate.angle), std::cos(plate.angle));
    plate.remote = stress * normal * normal.transpose();
    const double K0 = stress * std::sqrt(std::numbers::pi * plate.half_length);
    const double G0 = K0 * K0 / plane_modulus();
    double worst_G = 0, mean_G = 0, worst_K_I = 0, worst_K_II = 0;
    for (int i = 0; i < places; ++i) {
        for (int j = 0; j < places; ++j) {
            plate.offset = Vec2(i, j) / places;
            const AtRest run(slanted_crack(plate));
            ASSERT_TRUE(run.solved());
            for (const bool at_end : {true, false}) {
                const TipLoad load = run.load(at_end);
                worst_G = std::max(worst_G, std::abs(load.G / G0 - 1));
                mean_G += (load.G / G0 - 1) / (2 * places * places);
                worst_K_I = std::max(worst_K_I, std::abs(load.K_I / K0 - 1));
                worst_K_II = std::max(worst_K_II, std::abs(load.K_II / K0));
            }
        }
    }
    std::printf("crack turned by %4.1f deg: G off by up to %.2f %%, %+.2f %% on average; K_I by up to %.2f %%, K_II %.2f %%\n",
                angle, 100 * worst_G, 100 * mean_G, 100 * worst_K_I, 100 * worst_K_II);
    EXPECT_LT(worst_G, 0.02) << angle;
    EXPECT_LT(worst_K_I, 0.01) << angle;  // half of what is asked of G
    EXPECT_LT(worst_K_II, 0.02) << angle;
}

TEST(VerificationTurnedCrack, GWhereverTheCrackLies) {
    // Asked: 2 % at 10 cells per half crack, wherever in a cell and however turned.
    for (const double angle : {0.0, 22.5, 37.5, 45.0, 75.0}) check_turned_crack(angle, 3);
}

TEST(SlowVerificationTurnedCrack, GInTenthsOfACell) {
    for (double angle = 0.0; angle <= 90.0; angle += 7.5) check_turned_crack(angle, 10);
}

void report(const char* name, const TipLoad& load, double K) {
    std::printf("%s: K_I off by %+.2f %%, G by %+.2f %%\n", name, 100 * (load.K_I / K - 1),
                100 * (load.G * plane_modulus() / (K * K) - 1));
    EXPECT_NEAR(load.K_I, K, 0.01 * K);
    EXPECT_LT(std::abs(load.K_II), 0.01 * K);
}

TEST(VerificationHandbook, EdgeCrackInTension) {
    // Ends free to rotate, 20 cells per crack length; Tada, Paris and Irwin's secant form, good to 0.5 % at any length.
    for (const double r : {0.2, 0.4, 0.5}) {
        const AtRest run(edge_crack(20.0, r, 4));
        ASSERT_TRUE(run.solved());
        report("edge crack", run.load(), edge_crack_K(r));
    }
}

TEST(VerificationHandbook, ThreePointBend) {
    // Span 4 W, 20 cells per crack length; Srawley 1976 (ASTM E399), good to 0.5 %.
    const double a = 10e-3, h = a / 20, r = 0.5, W = a / r, S = 4 * W, L = 4.4 * W;
    Scene scene = at_rest({L, W}, h);
    scene.edges = {held_at("punch", Side::top, 0.5 * L, h, 0.0, -1e-5),
                   held_at("left", Side::bottom, 0.5 * (L - S), h, std::nullopt, 0.0),
                   held_at("right", Side::bottom, 0.5 * (L + S), h, std::nullopt, 0.0)};
    Crack crack;
    crack.points = {Vec2(0.5 * L, 0.0), Vec2(0.5 * L, a)};
    scene.cracks = {crack};
    scene.measure = {"punch", "punch"};
    const AtRest run(scene);
    ASSERT_TRUE(run.solved());
    const double P = -run.equilibrium.reactions()[0].y();
    const double f =
        1.5 * std::sqrt(r) * (1.99 - r * (1 - r) * (2.15 - 3.93 * r + 2.7 * r * r)) / ((1 + 2 * r) * std::pow(1 - r, 1.5));
    report("three-point bend", run.load(), P * S / std::pow(W, 1.5) * f);
}

TEST(VerificationHandbook, CompactTension) {
    // 20 cells per crack length, pins of 0.24 W in holes of 0.25 W; Srawley 1976 (ASTM E399), good to 0.5 %.
    const double a = 10e-3, h = a / 20, r = 0.5, W = a / r, H = 1.2 * W, hole = 0.125 * W, pin = 0.12 * W, pull = 1e-5;
    Scene scene = at_rest({1.25 * W, H}, h);
    for (const double up : {1.0, -1.0}) {
        const Vec2 centre(0.25 * W, 0.5 * H + up * 0.275 * W);
        scene.specimen.cutouts.push_back(Circle{centre, hole});
        scene.bodies.push_back({up > 0 ? "upper" : "lower", Circle{centre, pin}, {}, Vec2(0.0, up * (hole - pin + pull)), {}});
    }
    scene.edges = {held_at("back", Side::right, 0.5 * H, h, 0.0, std::nullopt)};
    Crack crack;
    crack.points = {Vec2(0.0, 0.5 * H), Vec2(0.25 * W + a, 0.5 * H)};
    scene.cracks = {crack};
    scene.measure = {"upper", "upper"};
    const AtRest run(scene);
    ASSERT_TRUE(run.solved());
    const double P = run.equilibrium.reactions()[1].y();
    const double f =
        (2 + r) * (0.886 + 4.64 * r - 13.32 * r * r + 14.72 * r * r * r - 5.6 * r * r * r * r) / std::pow(1 - r, 1.5);
    report("compact tension", run.load(), P / std::sqrt(W) * f);
}

TEST(VerificationHandbook, DoubleCantileverBeam) {
    // REFERENCES: 100 x 24 mm, tip at 51 mm, E = 100 kPa, P / B = 0.4 N/m at 99.5 mm, plane strain. Asked: 1 % of G.
    const AtRest run(double_cantilever(12.0, 4));
    ASSERT_TRUE(run.solved());
    const double E = 1e5 / (1 - 0.33 * 0.33), G = double_cantilever_G();
    const TipLoad load = run.load();
    std::printf("double cantilever beam: G off by %+.2f %%, by K_I %+.2f %%\n", 100 * (load.G / G - 1),
                100 * (load.K_I * load.K_I / E / G - 1));
    EXPECT_NEAR(load.G, G, 0.01 * G);
    EXPECT_NEAR(load.K_I * load.K_I / E, G, 0.01 * G);
}

TEST(VerificationTipLoad, KDoesNotFeelRigidRotation) {
    // The displacement of a slanted crack, and the same seen after the plate has turned as a whole by up to 60 degrees. (G is not
    // compared: the turned plate is out of balance by the strain squared, which a virtual shift of turned wood does feel.)
    SlantedCrack plate;
    plate.angle = 30 * degree;
    plate.remote(1, 1) = 1e3;  // strains of 1e-4: what is left of finite strain is as small
    const AtRest run(slanted_crack(plate));
    ASSERT_TRUE(run.solved());
    const TipLoad still = run.load();
    EnergyReleaseOptions options;
    options.rotates = true;
    const auto& u = run.equilibrium.displacements();
    for (const double angle : {0.0, 20.0, 60.0}) {
        Mat2 R;
        R << std::cos(angle * degree), -std::sin(angle * degree), std::sin(angle * degree), std::cos(angle * degree);
        std::vector<Vec2> turned;
        for (std::size_t f = 0; f < u.size(); ++f) {
            const Vec2 x = run.body.layout.node_position(run.equilibrium.cracks().node_of_field[f]);
            turned.push_back(R * (x + u[f]) - x);
        }
        const std::vector<Vec2> rest(u.size(), Vec2::Zero());
        const TipLoad load = tip_load(run.body, run.equilibrium.cracks(), run.materials, 0, true, {turned, rest, rest}, options);
        EXPECT_NEAR(load.K_I, still.K_I, 1e-3 * still.K_I) << angle;
        EXPECT_NEAR(load.K_II, still.K_II, 1e-3 * still.K_I) << angle;
    }
}

TEST(VerificationTipLoad, KOfThinArmsThatTurnFar) {
    // Arms drawn apart until they have turned by some 40 degrees: the energy that a further cell gives up.
    const auto at_tip = [](double tip) {
        Scene scene = at_equilibrium(block({40e-3, 6e-3}, 0.5e-3));
        Crack crack;
        crack.points = {Vec2(0.0, 3e-3), Vec2(tip, 3e-3)};
        scene.cracks = {crack};
        Edge upper = moving("upper", Side::left, {0.0, 1e-3}), lower = moving("lower", Side::left, {0.0, -1e-3});
        upper.range = {{3e-3, 6e-3}};
        lower.range = {{0.0, 3e-3}};
        upper.velocity[0] = lower.velocity[0] = std::nullopt;
        scene.edges = {upper, lower, moving("right", Side::right, {0.0, 0.0})};
        scene.measure = {"upper", "upper"};
        scene.stop.displacement = 10e-3;
        scene.solver.strain = StrainMeasure::finite_rotation;
        return std::pair{simulate(scene).series.back(), scene.model.thickness};
    };
    const auto [here, thickness] = at_tip(20e-3);
    const double given = (at_tip(19.5e-3).first.strain_energy - at_tip(20.5e-3).first.strain_energy) / (1e-3 * thickness);
    const double plane_modulus = 40e6 / (1 - 0.33 * 0.33);
    std::printf("thin arms turned far: G %+.2f %%, by K %+.2f %% off what the energy gives\n", 100 * (here.G / given - 1),
                100 * ((here.K_I * here.K_I + here.K_II * here.K_II) / plane_modulus / given - 1));
    EXPECT_NEAR(here.G, given, 0.02 * given);
    EXPECT_NEAR((here.K_I * here.K_I + here.K_II * here.K_II) / plane_modulus, given, 0.02 * given);
    EXPECT_LT(std::abs(here.K_II), 1e-3 * here.K_I);
}

// --- Paths

// A crack from the left side at 45 degrees, in a block that is pulled: it turns across the load and stays in mode I, as criteria
// that agree to first order all say (Cotterell and Rice 1980). Steps of half a cell, as the walk at equilibrium takes.
void check_path(GrowthDirection criterion, const char* name) {
    const double h = 0.5e-3;
    Scene scene = at_rest({20e-3, 20e-3}, h);
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    Crack crack;
    crack.points = {Vec2(0.0, 5e-3), Vec2(6e-3, 11e-3)};
    scene.cracks = {crack};
    AtRest run(scene);
    double worst = 0.0;
    for (int step = 0; step < 40; ++step) {
        const CrackTip tip = run.equilibrium.cracks().lines[0].end;
        const TipLoad load = run.load();
        if (step > 8) worst = std::max(worst, std::abs(load.K_II / load.K_I));  // the bend lies behind the domain from then on
        const Vec2 way = growth_direction(criterion, tip, load, run.materials, 0.5 * h);
        run.equilibrium.grow(0, true, tip.position + 0.5 * h * way);
        ASSERT_EQ(run.equilibrium.solve(1.0), Equilibrium::Outcome::solved);
    }
    std::printf("path by %s: K_II/K_I up to %.3f\n", name, worst);
    EXPECT_LT(worst, 0.03);  // a direction to 4 degrees
}

// Sheared more than opened, faces apart: K_I 0.0282, K_II 0.198 MPa sqrt(m) by finite elements of our own (6 nodes, those at the
// tip with midside nodes at a quarter, interaction integral, within 0.15 % on slanted cracks of textbooks).
TEST(VerificationPath, AnOpenCrackNearModeIIKeepsItsModeI) {
    for (const double cell : {0.2e-3, 0.1e-3}) {
        Scene scene = at_equilibrium(block({12e-3, 10e-3}, cell));
        scene.materials["EW"] = {1000e6, 0.3, 300.0, 100.0};
        scene.edges = {moving("top", Side::top, {5e-3, 2.2e-3}), moving("bottom", Side::bottom, {0.0, 0.0})};
        Crack crack;
        crack.points = {Vec2(0.0, 4e-3), Vec2(5e-3, 6.5e-3)};
        scene.cracks = {crack};
        scene.measure = {"top", "top"};
        scene.stop.time = 10e-3;
        const Instant end = simulate(scene).series.back();
        std::printf("near mode II on %.1f mm cells: K_I %.4f, K_II %.4f MPa sqrt(m)\n", 1e3 * cell, 1e-6 * end.K_I,
                    1e-6 * end.K_II);
        EXPECT_NEAR(end.K_I, 2.82e4, 0.025 * 2e5);
        EXPECT_NEAR(end.K_II, 1.982e5, 0.02 * 2e5);
    }
}

TEST(VerificationPath, StaysInModeI) {
    check_path(GrowthDirection::hoop_stress, "hoop stress");
    check_path(GrowthDirection::energy_release_rate, "energy release rate");
}

// K at the tip of a short branch of so many cells, in K_0 of a main crack of 40 to the half, pulled across; G, in K_0^2 / E'.
struct Branch {
    Vec2 K;
    double G;
};
Branch branch(double turn, double leg) {
    SlantedCrack plate;
    plate.cells = 40.0;
    plate.remote << 0, 0, 0, 1e5;
    plate.offset = {0.3, 0.4};
    Scene scene = slanted_crack(plate);
    const Vec2 way(std::cos(turn * degree), std::sin(turn * degree));
    scene.cracks[0].points.push_back(scene.cracks[0].points.back() + leg * plate.half_length / plate.cells * way);
    const AtRest run(scene);
    EXPECT_TRUE(run.solved());
    const TipLoad load = run.load();
    const double K0 = 1e5 * std::sqrt(std::numbers::pi * plate.half_length);
    return {Vec2(load.K_I, load.K_II) / K0, load.G * plane_modulus() / (K0 * K0)};
}

// Why a crack that K steers goes straight for a cell and a half after a sharp turn: K of a short branch is that of Amestoy and
// Leblond (1992) from there on, and far off before.
TEST(VerificationPath, ABranchIsSeenOnceItIsLongEnough) {
    for (const double turn : {20.0, 40.0}) {
        const Vec2 exact = branch_intensities(turn * degree, 1.0, 0.0);
        const auto off = [&](double leg) {
            const Vec2 K = branch(turn, leg).K;
            std::printf("turned by %.0f degrees, %.2f cells ago: K_I %.3f, K_II %.3f of K_0, exact %.3f, %.3f\n", turn, leg, K[0],
                        K[1], exact[0], exact[1]);
            return std::abs(K[1] - exact[1]);
        };
        EXPECT_LT(off(1.5), 0.5 * off(0.5));
    }
}

// While the kink lies in the domain: K goes to that of Amestoy and Leblond as the branch becomes short, with the root of its
// length as they have it, and releases G.
TEST(VerificationPath, KBehindASharpKink) {
    const std::array legs{1.5, 2.0, 3.0, 4.0, 6.0};
    for (const double turn : {40.0, 55.0, 70.0}) {
        Eigen::Matrix<double, 5, 2> by_length, K;
        double worst = 0.0;
        for (int i = 0; i < 5; ++i) {
            const Branch at_tip = branch(turn, legs[i]);
            by_length.row(i) << 1.0, std::sqrt(legs[i]);
            K.row(i) = at_tip.K.transpose();
            worst = std::max(worst, std::abs(at_tip.K.squaredNorm() / at_tip.G - 1.0));
        }
        const Vec2 exact = branch_intensities(turn * degree, 1.0, 0.0);
        const Vec2 shortest = by_length.colPivHouseholderQr().solve(K).row(0).transpose();
        std::printf(
            "kink of %.0f degrees: K^2 off G by up to %.1f %%; of no length K_I %.3f, K_II %.3f of K_0, exact %.3f, %.3f\n", turn,
            100.0 * worst, shortest[0], shortest[1], exact[0], exact[1]);
        EXPECT_LT(worst, 0.06);  // without the faces behind the kink: 26 %
        EXPECT_LT((shortest - exact).cwiseAbs().maxCoeff(), 0.04);
    }
}

// Pulled across, a crack at 37 degrees kinks once and goes on without a corner (Amestoy and Leblond 1992: the turn after a kink
// goes with the root of the way). The grid must not see its own kink as a load that turns it back. `most` [degrees] from leg to
// leg.
void check_kink(const Scene& of_solver, double most) {
    for (const GrowthDirection criterion : {GrowthDirection::hoop_stress, GrowthDirection::energy_release_rate}) {
        Scene scene = of_solver;
        Crack crack;
        crack.points = {Vec2(0.0, 14e-3), Vec2(8e-3, 20e-3)};
        crack.grows = Growth::end;
        crack.direction = criterion;
        crack.advance = 0.5e-3;
        scene.cracks = {crack};
        scene.measure = {"top", "top"};
        scene.stop.displacement = 4e-3;
        scene.stop.crack_length = 16e-3;
        const std::vector<Vec2> path = simulate(scene).paths[0];
        ASSERT_GT(path.size(), 4u);
        double kink = 0.0, worst = 0.0;
        for (std::size_t k = 1; k + 1 < path.size(); ++k) {
            const Vec2 before = path[k] - path[k - 1], after = path[k + 1] - path[k];
            const double turn = std::abs(std::atan2(cross(before, after), before.dot(after))) / degree;
            if (k == 1) kink = turn;
            else worst = std::max(worst, turn);
        }
        std::printf("kinks by %.1f degrees, then turns by up to %.1f from leg to leg\n", kink, worst);
        EXPECT_GT(kink, 30.0);
        EXPECT_LT(worst, most);
    }
}

TEST(VerificationPath, KinksOnceAtEquilibrium) {
    Scene scene = at_equilibrium(block({40e-3, 40e-3}, 0.5e-3));
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    check_kink(scene, 3.0);
}

TEST(VerificationPath, KinksOnceInMotion) {
    Scene scene = block({40e-3, 40e-3}, 0.5e-3);
    scene.solver.kind = SolverKind::explicit_dynamics;
    scene.edges = {moving("top", Side::top, {0.0, 1.0}), moving("bottom", Side::bottom, {0.0, 0.0})};
    check_kink(scene, 6.0);  // waves swing K
}

// --- Layers

void check_laminated_strip(double cell, double lift) {
    const RingMeans means = over_one_ring({.cell = cell, .lift = lift});
    std::printf("laminated strip, %.1f mm cells, crack %.1f cells up: energy released over a ring off by %+.2f %%; "
                "mean of G by %+.1f %%, of K^2/E' by %+.1f %%\n",
                1e3 * cell, lift, 100 * means.potential, 100 * means.G, 100 * means.K);
    // Asked: 2 %. G and K at tips within a cell or two of a boundary are the grid's own and are reported only.
    EXPECT_LT(std::abs(means.potential), 0.02);
}

TEST(VerificationLaminatedStrip, EnergyOverARing) {
    for (const double lift : {0.0, 0.5}) check_laminated_strip(0.2e-3, lift);
}

TEST(SlowVerificationLaminatedStrip, EnergyOverARing) {
    for (const double lift : {0.0, 0.5}) check_laminated_strip(0.1e-3, lift);
}

// A specimen that turns as a whole takes its crack's opening along.
TEST(UnitTipLoad, OpeningIsSeenInTheWoodsOwnFrame) {
    Scene scene = at_rest({10e-3, 10e-3}, 0.5e-3);
    scene.edges = {moving("top", Side::top, {1e-4, 3e-4}), moving("bottom", Side::bottom, {0.0, 0.0})};
    Crack crack;
    crack.points = {Vec2(0.0, 5.1e-3), Vec2(5e-3, 5.1e-3)};
    scene.cracks = {crack};
    scene.measure = {"top", "top"};
    const AtRest run(scene);
    ASSERT_TRUE(run.solved());
    const CrackFields& cracks = run.equilibrium.cracks();
    const std::vector<Vec2>& u = run.equilibrium.displacements();
    const Vec2 still = opening_in_own_frame(run.body, cracks, 0, true, u, true);
    const Vec2 small = opening_in_own_frame(run.body, cracks, 0, true, u, false);
    EXPECT_LT((still - small).norm(), 0.05 * small.norm());
    const Mat2 turn = (Mat2() << std::cos(2.0), -std::sin(2.0), std::sin(2.0), std::cos(2.0)).finished();
    std::vector<Vec2> turned(u.size());
    for (std::size_t f = 0; f < u.size(); ++f) {
        const Vec2 x = run.body.layout.node_position(cracks.node_of_field[f]);
        turned[f] = turn * (x + u[f]) - x;
    }
    EXPECT_LT((opening_in_own_frame(run.body, cracks, 0, true, turned, true) - still).norm(), 1e-9 * still.norm());
}

}  // namespace
}  // namespace crampfit::test
