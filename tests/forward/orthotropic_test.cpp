// Orthotropic wood: stiffness, directions by place, crack tips. Closed forms of anisotropic plates.
#include "forward/near_tip_field.hpp"
#include "forward/transition_wood.hpp"
#include "tests/forward/cracked_plates.hpp"

#include "datasets/error.hpp"

#include <Eigen/LU>
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>

namespace crampfit::test {
namespace {

// Softer along the rings than across and much softer in shear, as softwood is.
OrthotropicElasticity softwood() { return {800e6, 400e6, 40e6, 0.45, 11e9, 0.4, 0.45}; }

Material wood(const OrthotropicElasticity& elasticity = softwood()) { return {0.0, 0.0, 400.0, 200.0, elasticity}; }

Vec2 toward(double angle) { return {std::cos(angle), std::sin(angle)}; }

const std::pair<const char*, std::pair<ElasticConstant, double OrthotropicElasticity::*>> constants[] = {
    {"E_R", {ElasticConstant::E_R, &OrthotropicElasticity::E_R}},
    {"E_T", {ElasticConstant::E_T, &OrthotropicElasticity::E_T}},
    {"G_RT", {ElasticConstant::G_RT, &OrthotropicElasticity::G_RT}},
    {"nu_RT", {ElasticConstant::nu_RT, &OrthotropicElasticity::nu_RT}},
    {"E_L", {ElasticConstant::E_L, &OrthotropicElasticity::E_L}},
    {"nu_LR", {ElasticConstant::nu_LR, &OrthotropicElasticity::nu_LR}},
    {"nu_LT", {ElasticConstant::nu_LT, &OrthotropicElasticity::nu_LT}}};

// --- Stiffness

TEST(UnitElasticity, OffAxisConstantsAreThoseOfTheTextbooks) {
    // Jones 1975, eq. 2.97: modulus and Poisson's ratio under stress at an angle to the axes.
    const auto [E_R, E_T, G, nu, E_L, nu_LR, nu_LT] = softwood();
    const Eigen::Matrix3d own = plane_stiffness(wood(), PlaneCondition::stress);
    for (const double angle : {0.0, 20.0, 45.0, 70.0, 90.0}) {
        const double c = std::cos(angle * degree), s = std::sin(angle * degree);
        const Eigen::Matrix3d a = from_axes(own, Vec2(c, s)).inverse();
        const double along = c * c * c * c / E_R + (1 / G - 2 * nu / E_R) * s * s * c * c + s * s * s * s / E_T;
        const double across = (s * s * s * s + c * c * c * c) * nu / E_R - (1 / E_R + 1 / E_T - 1 / G) * s * s * c * c;
        EXPECT_NEAR(a(0, 0), along, 1e-13 * along);
        EXPECT_NEAR(a(0, 1), -across, 1e-13 * along);
        EXPECT_LT((in_axes(from_axes(own, Vec2(c, s)), Vec2(c, s)) - own).norm(), 1e-14 * own.norm());
    }
}

TEST(UnitElasticity, PlaneStrainIsTheSpaceStiffnessBetweenRigidPlates) {
    // The compliance in R, T, L inverted whole; its R-T block is the stiffness without strain along L.
    const auto [E_R, E_T, G, nu_RT, E_L, nu_LR, nu_LT] = softwood();
    Eigen::Matrix3d a;
    a << 1 / E_R, -nu_RT / E_R, -nu_LR / E_L, -nu_RT / E_R, 1 / E_T, -nu_LT / E_L, -nu_LR / E_L, -nu_LT / E_L, 1 / E_L;
    const Eigen::Matrix3d space = a.inverse();
    const Eigen::Matrix3d plane = plane_stiffness(wood(), PlaneCondition::strain);
    EXPECT_LT((plane.topLeftCorner<2, 2>() - space.topLeftCorner<2, 2>()).norm(), 1e-13 * space.norm());
    EXPECT_NEAR(plane(2, 2), G, 1e-14 * G);
}

TEST(UnitElasticity, EqualConstantsAllWaysAreIsotropic) {
    const double E = 40e6, nu = 0.33;
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        const Eigen::Matrix3d isotropic = plane_stiffness({E, nu, 300.0, 100.0}, plane);
        const Eigen::Matrix3d same = plane_stiffness(wood({E, E, 0.5 * E / (1 + nu), nu, E, nu, nu}), plane);
        EXPECT_LT((from_axes(same, toward(0.7)) - isotropic).norm(), 1e-14 * isotropic.norm());
        EXPECT_LT((plane_compliance({E, nu, 300.0, 100.0}, plane) * isotropic - Eigen::Matrix3d::Identity()).norm(), 1e-14);
    }
}

// Worst difference between the slope by a constant and central differences of 1e-5 of it (error of the differences 1e-10), over
// the slope.
template <class Change>
double slope_error(const Material& material, PlaneCondition plane, ElasticConstant constant, double value, Change change) {
    const double step = 1e-5 * value;
    Material more = material, less = material;
    change(more, value + step);
    change(less, value - step);
    const Eigen::Matrix3d differences = (plane_stiffness(more, plane) - plane_stiffness(less, plane)) / (2 * step);
    return (plane_stiffness_slope(material, plane, constant) - differences).norm() / differences.norm();
}

TEST(GradientElasticity, EveryConstant) {
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        for (const auto& [name, what] : constants) {
            const auto& [constant, member] = what;
            const bool axial = name[0] == 'E' ? name[2] == 'L' : name[3] == 'L';
            if (axial && plane == PlaneCondition::stress) {
                EXPECT_EQ(plane_stiffness_slope(wood(), plane, constant).norm(), 0.0) << name;
                continue;
            }
            const auto set = [&, m = member](Material& material, double value) { (*material.orthotropic).*m = value; };
            const double error = slope_error(wood(), plane, constant, softwood().*member, set);
            std::printf("slope of the stiffness by %s: off by %.1e\n", name, error);
            EXPECT_LT(error, 1e-9) << name;
        }
        const Material isotropic{40e6, 0.33, 300.0, 100.0};
        EXPECT_LT(slope_error(isotropic, plane, ElasticConstant::E, 40e6, [](Material& m, double v) { m.youngs_modulus = v; }),
                  1e-9);
        EXPECT_LT(slope_error(isotropic, plane, ElasticConstant::nu, 0.33, [](Material& m, double v) { m.poisson_ratio = v; }),
                  1e-9);
    }
}

TEST(UnitElasticity, LayeredFormComesBack) {
    const Eigen::Matrix3d C = from_axes(plane_stiffness(wood(), PlaneCondition::strain), toward(0.4));
    for (const double angle : {0.0, 0.4, 1.0, 2.5})
        EXPECT_LT((layered(C, toward(angle)).stiffness() - C).norm(), 1e-13 * C.norm());
}

TEST(UnitElasticity, RayleighWaveOfIsotropicWood) {
    // nu = 1/4 in plane strain: c^2 = (2 - 2 / 3^1/2) mu / rho (Rayleigh 1885).
    const Eigen::Matrix3d C = layered(plane_elasticity(2.5, 0.25, PlaneCondition::strain)).stiffness();
    EXPECT_NEAR(rayleigh_speed(C, 1.0), std::sqrt(2 - 2 / std::sqrt(3.0)), 1e-9);
}

TEST(UnitElasticity, NoStressFromRotationAlone) {
    const Eigen::Matrix3d C = from_axes(plane_stiffness(wood(), PlaneCondition::strain), toward(0.5));
    Mat2 stretch;
    stretch << 0.01, -0.004, -0.004, 0.02;
    const PointState still = elastic_state(stretch, C, true);
    for (const double angle : {30.0, 75.0, -120.0}) {
        Mat2 R;
        R << toward(angle * degree), left_of(toward(angle * degree));
        EXPECT_LT(elastic_state(R - Mat2::Identity(), C, true).stress.norm(), 1e-15 * C.norm());
        const PointState turned = elastic_state(R * (Mat2::Identity() + stretch) - Mat2::Identity(), C, true);
        EXPECT_NEAR(turned.energy, still.energy, 1e-12 * still.energy);
        EXPECT_LT((turned.stress - R * still.stress).norm(), 1e-12 * still.stress.norm());
    }
}

// --- Patches

Scene plate(double radial, PlaneCondition plane) {
    Scene scene = at_rest({10e-3, 8e-3}, 1e-3);
    scene.model.plane = plane;
    scene.materials["EW"] = wood();
    scene.specimen.radial = radial;
    scene.measure = {"top", "top"};
    return scene;
}

TEST(VerificationOrthotropicPatch, StressOnTheSidesStrainsAsTheTurnedComplianceSays) {
    Mat2 pull = Mat2::Zero(), shear = Mat2::Zero();
    pull(1, 1) = shear(0, 1) = shear(1, 0) = 1e4;
    double worst = 0.0;
    for (const PlaneCondition plane : {PlaneCondition::strain, PlaneCondition::stress}) {
        for (const double angle : {0.0, 15.0, 45.0, 77.0, 120.0}) {
            for (const Mat2& stress : {pull, shear}) {
                Scene scene = plate(angle * degree, plane);
                scene.edges = {pulled("top", Side::top, stress.col(1)),
                               pulled("bottom", Side::bottom, -stress.col(1)),
                               pulled("right", Side::right, stress.col(0)),
                               pulled("left", Side::left, -stress.col(0)),
                               held_at("hinge", Side::left, 4e-3, 1e-3, 0.0, 0.0),
                               held_at("slide", Side::right, 4e-3, 1e-3, std::nullopt, 0.0)};
                const AtRest run(scene);
                ASSERT_TRUE(run.solved());
                const Vec2 r = toward(angle * degree);
                const Eigen::Matrix3d a = from_axes(plane_compliance(wood(), plane).inverse(), r).inverse();
                const Eigen::Vector3d expected = a * Eigen::Vector3d(stress(0, 0), stress(1, 1), stress(0, 1));
                for (int p = 0; p < run.body.points.count(); ++p) {
                    const Mat2 g = gradient_at(run.body, p, run.equilibrium.displacements());
                    const Eigen::Vector3d strain(g(0, 0), g(1, 1), g(0, 1) + g(1, 0));
                    worst = std::max(worst, (strain - expected).norm() / expected.norm());
                }
            }
        }
    }
    std::printf("patches at five grain angles: strain off by up to %.1e\n", worst);
    EXPECT_LT(worst, 1e-10);  // rounding times the condition of the system
}

TEST(VerificationOrthotropicPatch, StressOutOfThePlane) {
    const Scene scene = plate(30 * degree, PlaneCondition::strain);
    const MaterialMap map(scene);
    const Discretisation body(scene, map);
    // Pulled along R by 1 Pa: nu_LR along L; along T: nu_LT.
    const auto out = [&](const Vec2& n) {
        return body.points.out_of_plane[0].dot(Eigen::Vector3d(n.x() * n.x(), n.y() * n.y(), n.x() * n.y()));
    };
    EXPECT_NEAR(out(toward(30 * degree)), softwood().nu_LR, 1e-14);
    EXPECT_NEAR(out(toward(120 * degree)), softwood().nu_LT, 1e-14);
}

// --- Cracks

// Lekhnitskii's roots in the axes of a crack that lies `turn` counter-clockwise from R (roots turned as in Lekhnitskii 1963, sec.
// 7).
std::array<std::complex<double>, 2> lekhnitskii_roots(const Eigen::Matrix3d& a, double turn) {
    using Complex = std::complex<double>;
    const double half = (2 * a(0, 1) + a(2, 2)) / (2 * a(0, 0)), last = a(1, 1) / a(0, 0);
    const Complex difference = std::sqrt(Complex(half * half - last));
    std::array<Complex, 2> roots;
    for (int k = 0; k < 2; ++k) {
        Complex s = std::sqrt(-half + (k == 0 ? 1.0 : -1.0) * difference);
        if (s.imag() < 0) s = -s;
        roots[k] = (s * std::cos(turn) - std::sin(turn)) / (std::cos(turn) + s * std::sin(turn));
    }
    return roots;
}

// Stress around a crack from -a to a on the x axis of an infinite anisotropic plate (Sih, Paris and Irwin 1965): that of the
// near-tip field with z / (z^2 - a^2)^1/2 in place of (a / 2 z)^1/2, and the stress along the crack that is missing far away.
struct AnisotropicGriffith {
    std::array<std::complex<double>, 2> roots;

    Mat2 operator()(const Mat2& remote, double a, const Vec2& x) const {
        using Complex = std::complex<double>;
        const auto [s1, s2] = roots;
        const auto f = [&](const Complex& s) {
            const Complex z = x.x() + s * x.y();
            return z / (std::sqrt(z - a) * std::sqrt(z + a));
        };
        const Complex f1 = f(s1), f2 = f(s2), d = 1.0 / (s1 - s2), both = s1 * s2;
        const double s = remote(1, 1), t = remote(0, 1);
        const double xx =
            s * (both * d * (s2 * f2 - s1 * f1) + both).real() + t * (d * (s2 * s2 * f2 - s1 * s1 * f1) + s1 + s2).real();
        const double yy = s * (d * (s1 * f2 - s2 * f1)).real() + t * (d * (f2 - f1)).real();
        const double xy = s * (both * d * (f1 - f2)).real() + t * (d * (s1 * f1 - s2 * f2)).real();
        Mat2 stress;
        stress << xx + remote(0, 0), xy, xy, yy;
        return stress;
    }
};

struct CrackedWood {
    double crack = 0.0;   // angle against the grid
    double radial = 0.0;  // of the grain against the grid
    double cells = 10.0;
    Mat2 remote = Mat2::Zero();  // in x, y [Pa]
    Vec2 offset = {0.13, 0.27};
    double longer = 0.0;  // at the end [m]
};

Scene cracked_wood(const CrackedWood& c) {
    SlantedCrack geometry;
    geometry.cells = c.cells;
    geometry.angle = c.crack;
    geometry.remote = c.remote;
    geometry.offset = c.offset;
    const AnisotropicGriffith exact{lekhnitskii_roots(plane_compliance(wood(), PlaneCondition::strain), c.crack - c.radial)};
    Scene scene = slanted_crack(geometry, exact);
    scene.materials["EW"] = wood();
    scene.specimen.radial = c.radial;
    scene.cracks[0].points[1] += c.longer * toward(c.crack);
    return scene;
}

TEST(VerificationOrthotropicCrack, KOfTheInfinitePlateIsThatOfIsotropicWood) {
    // Sih, Paris and Irwin 1965: K_I = s_n (pi a)^1/2, K_II = t (pi a)^1/2 whatever the wood, where the faces carry no resultant.
    // Along an axis G = K_I^2 (b11 b22 / 2)^1/2 ((b22 / b11)^1/2 + (2 b12 + b66) / (2 b11))^1/2. Bars as for isotropic wood, on
    // twice as many cells: shear as soft as this makes the near-tip field as much steeper.
    const double stress = 1e5, a = 10e-3, K0 = stress * std::sqrt(std::numbers::pi * a);
    const Eigen::Matrix3d b = plane_compliance(wood(), PlaneCondition::strain);
    const auto sih = [&](double b11, double b22) {
        return K0 * K0 * std::sqrt(b11 * b22 / 2) * std::sqrt(std::sqrt(b22 / b11) + (2 * b(0, 1) + b(2, 2)) / (2 * b11));
    };
    for (const double crack : {0.0, 25.0}) {
        for (const double grain : {0.0, 30.0, 60.0, 90.0, 135.0}) {
            CrackedWood c;
            c.crack = crack * degree;
            c.radial = grain * degree;
            c.remote(1, 1) = stress;
            c.cells = 20;
            const AtRest run(cracked_wood(c));
            ASSERT_TRUE(run.solved());
            const double K_I = K0 * std::cos(c.crack) * std::cos(c.crack), K_II = K0 * std::cos(c.crack) * std::sin(c.crack);
            const Mat2 H = near_tip_field(from_axes(b.inverse(), toward(c.radial)), toward(c.crack)).release();
            const double G = Vec2(K_I, K_II).dot(H * Vec2(K_I, K_II));
            if (crack == 0.0 && (grain == 0.0 || grain == 90.0)) {
                const bool along = grain == 0.0;
                EXPECT_NEAR(G, along ? sih(b(0, 0), b(1, 1)) : sih(b(1, 1), b(0, 0)), 1e-12 * G);
            }
            for (const bool at_end : {true, false}) {
                const TipLoad load = run.load(at_end);
                std::printf(
                    "crack at %4.1f, grain at %5.1f deg, %s: K_I off by %+.2f %%, K_II by %+.2f %% of K0, G by %+.2f %%\n", crack,
                    grain, at_end ? "end  " : "start", 100 * (load.K_I - K_I) / K0, 100 * (load.K_II - K_II) / K0,
                    100 * (load.G / G - 1));
                EXPECT_NEAR(load.K_I, K_I, 0.02 * K0);
                EXPECT_NEAR(load.K_II, K_II, 0.02 * K0);
                EXPECT_NEAR(load.G, G, 0.02 * G);
            }
        }
    }
}

TEST(VerificationOrthotropicCrack, GIsTheLossOfPotentialPerCrackLength) {
    // -dPi / da by central differences, tractions on the sides held. Over five cells either way, as the tip of a crack oblique to
    // the grid lies exact to a tenth of a cell.
    for (const auto& [crack, grain] : {std::pair{0.0, 40.0}, {30.0, 0.0}, {30.0, 75.0}}) {
        CrackedWood c;
        c.crack = crack * degree;
        c.radial = grain * degree;
        c.remote(1, 1) = 1e5;
        c.cells = 20;
        const double step = 5 * 10e-3 / c.cells;
        double potential[2];
        for (const int k : {0, 1}) {
            c.longer = k == 0 ? -step : step;
            const AtRest run(cracked_wood(c));
            ASSERT_TRUE(run.solved());
            potential[k] = run.equilibrium.potential();
        }
        c.longer = 0.0;
        const double G = AtRest(cracked_wood(c)).load().G, loss = (potential[0] - potential[1]) / (2 * step);
        std::printf("crack at %.0f, grain at %.0f deg: G by the domain over -dPi/da: off by %+.2f %%\n", crack, grain,
                    100 * (G / loss - 1));
        EXPECT_NEAR(G, loss, 0.02 * loss);
    }
}

Scene orthotropic_edge_crack(double cell) {
    Scene scene = at_rest({20e-3, 20e-3}, cell);
    scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
    scene.measure = {"top", "top"};
    Crack crack;
    crack.points = {Vec2(0.0, 10.2e-3), Vec2(6.1e-3, 10.2e-3)};
    scene.cracks = {crack};
    return scene;
}

TEST(VerificationOrthotropicCrack, EqualConstantsRunAsIsotropicWood) {
    Scene scene = orthotropic_edge_crack(0.5e-3);
    const TipLoad isotropic = AtRest(scene).load();
    const double E = earlywood().youngs_modulus, nu = earlywood().poisson_ratio;
    scene.materials["EW"] = {0.0, 0.0, earlywood().density, earlywood().toughness,
                             OrthotropicElasticity{E, E, 0.5 * E / (1 + nu), nu, E, nu, nu}};
    for (const double radial : {0.0, 0.6}) {
        scene.specimen.radial = radial;
        const TipLoad same = AtRest(scene).load();
        EXPECT_NEAR(same.G, isotropic.G, 1e-10 * isotropic.G);  // rounding times the condition of the system
        EXPECT_NEAR(same.K_I, isotropic.K_I, 1e-10 * isotropic.K_I);
        EXPECT_NEAR(same.K_II, isotropic.K_II, 1e-10 * isotropic.K_I);
    }
}

// Which of two ways tells G near other wood hangs on the wood of the cells at the tip, not on axes in which it is written: the
// scene mirrored has the same. Tips on a line of the grid, on a node, and off both.
TEST(VerificationOrthotropicCrack, GAmongRingsIsTheSameMirrored) {
    struct Case {
        double cell, pith, across;
        Vec2 from, tip;
    };
    for (const Case& one : {Case{0.5e-3, 7.81391285e-3, 0.0, {0.0, 3.0357e-3}, {6e-3, 2.875e-3}},
                            {1e-3, 7.15822923e-3, -1e-5, {3.0273186e-3, 5.5993699e-3}, {8e-3, 6e-3}},
                            {0.5e-3, 4.9584818e-3, 0.0, {4.5250481e-3, 6.04794e-3}, {4.7570099e-3, 6.9892594e-3}}}) {
        std::vector<TipLoad> loads;
        for (const Vec2& sign : {Vec2(1.0, 1.0), Vec2(-1.0, 1.0), Vec2(1.0, -1.0)}) {
            const Vec2 size(12e-3, 10e-3);
            const auto image = [&](const Vec2& x) -> Vec2 { return 0.5 * size + sign.cwiseProduct(x - 0.5 * size); };
            Scene scene = at_rest(size, one.cell);
            const bool above = sign.y() > 0.0;
            scene.edges = {moving("pulled", above ? Side::top : Side::bottom, Vec2(one.across, 1e-5).cwiseProduct(sign)),
                           moving("held", above ? Side::bottom : Side::top, {0.0, 0.0})};
            scene.measure = {"pulled", "pulled"};
            scene.materials["EW"] = wood();
            scene.materials["LW"] = wood({2000e6, 1000e6, 100e6, 0.45, 27.5e9, 0.4, 0.45});
            scene.specimen.material.clear();
            scene.specimen.rings = Rings{image(Vec2(-20e-3, one.pith)), 2.2e-3, 0.25, 0.0};
            Crack crack;
            crack.points = {image(one.from), image(one.tip)};
            scene.cracks = {crack};
            loads.push_back(AtRest(scene).load());
        }
        std::printf("tip at %.3f, %.3f mm: G %.4g, mirrored %.4g, %.4g J/m^2\n", 1e3 * one.tip.x(), 1e3 * one.tip.y(), loads[0].G,
                    loads[1].G, loads[2].G);
        for (const TipLoad& load : loads) EXPECT_NEAR(load.G, loads[0].G, 0.01 * loads[0].G);
    }
}

TEST(VerificationOrthotropicCrack, GWhereTheGrainTurns) {
    // The pith lies 12 mm from the tip: the grain turns by a degree a cell, and G carries its turning explicitly.
    Scene scene = orthotropic_edge_crack(0.2e-3);
    scene.materials["EW"] = wood();
    scene.specimen.pith = Vec2(6e-3, -2e-3);
    const double step = 0.1e-3;
    double potential[2];
    for (const int k : {0, 1}) {
        Scene beside = scene;
        beside.cracks[0].points[1].x() += k == 0 ? -step : step;
        const AtRest run(beside);
        ASSERT_TRUE(run.solved());
        potential[k] = run.equilibrium.potential();
    }
    const AtRest run(scene);
    const TipLoad load = run.load();
    const double loss = (potential[0] - potential[1]) / (2 * step);
    const Vec2 tip = scene.cracks[0].points[1];
    const Mat2 H = near_tip_field(run.materials.at(tip).elasticity.stiffness(), Vec2::UnitX()).release();
    const Vec2 K(load.K_I, load.K_II);
    std::printf("grain that turns: G over -dPi/da off by %+.2f %%, by K %+.2f %%\n", 100 * (load.G / loss - 1),
                100 * (K.dot(H * K) / loss - 1));
    EXPECT_NEAR(load.G, loss, 0.02 * loss);
    EXPECT_NEAR(K.dot(H * K), loss, 0.02 * loss);
}

// --- Directions by place

Specimen map_of(const Scene& scene, double pixel) {
    const Rings& rings = *scene.specimen.rings;
    Specimen map;
    map.columns = static_cast<int>(std::lround(scene.specimen.size.x() / pixel));
    map.rows = static_cast<int>(std::lround(scene.specimen.size.y() / pixel));
    map.pixel = pixel;
    map.classes = {"EW", "LW"};
    for (int row = map.rows - 1; row >= 0; --row) {
        for (int column = 0; column < map.columns; ++column) {
            const Vec2 arm = pixel * Vec2(column + 0.5, row + 0.5) - rings.pith;
            const double turns = arm.norm() / rings.period;
            map.label.push_back(turns - std::floor(turns) > 1.0 - rings.latewood_fraction);
            map.orientation.push_back(static_cast<float>(std::atan2(arm.y(), arm.x())));
        }
    }
    return map;
}

TEST(VerificationGrain, AMapOfAnglesRunsAsTheRingsThatItWasDrawnFrom) {
    Scene scene = ring_specimen(3e-3, 0.2e-3);
    scene.solver.kind = SolverKind::quasistatic;
    scene.solver.damping = 0.0;
    scene.specimen.rings->pith = {-6e-3, 1e-3};
    scene.materials["EW"] = wood();
    scene.materials["LW"] = wood({2400e6, 3000e6, 300e6, 0.35, 20e9, 0.4, 0.45});
    const AtRest rings(scene);
    ASSERT_TRUE(rings.solved());
    scene.specimen.map = std::make_shared<Specimen>(map_of(scene, 0.01e-3));
    scene.specimen.rings.reset();
    scene.specimen.file = "map.h5";
    const AtRest map(scene);
    ASSERT_TRUE(map.solved());
    const double force = map.equilibrium.reactions()[0].y() / rings.equilibrium.reactions()[0].y();
    std::printf("map against rings: force %+.3f %%, G %+.3f %%, K_II %+.3f %% of K_I\n", 100 * (force - 1),
                100 * (map.load().G / rings.load().G - 1), 100 * (map.load().K_II - rings.load().K_II) / rings.load().K_I);
    // Pixels see a boundary to their own size, 1/20 of a cell.
    EXPECT_NEAR(force, 1.0, 1e-3);
    EXPECT_NEAR(map.load().G, rings.load().G, 5e-3 * rings.load().G);
}

TEST(UnitGrain, TurnsWithThePicture) {
    Scene scene = plate(0.0, PlaneCondition::strain);
    scene.specimen.radial.reset();
    Specimen map;
    map.columns = map.rows = 10;
    map.pixel = 1e-3;
    map.classes = {"EW"};
    map.label.assign(100, 0);
    map.orientation.assign(100, 0.3f);
    scene.specimen.map = std::make_shared<Specimen>(map);
    scene.specimen.material.clear();
    scene.specimen.file = "map.h5";
    scene.specimen.file_rotation = 0.5;
    const MaterialMap materials(scene);
    EXPECT_NEAR(std::abs(cross(materials.at(Vec2(4e-3, 4e-3)).elasticity.normal, toward(0.8))), 0.0, 1e-7);
    const LocalWood mean = materials.average(Vec2(4e-3, 4e-3), Vec2(0.5e-3, 0.5e-3));
    const Eigen::Matrix3d expected = from_axes(plane_stiffness(wood(), PlaneCondition::strain), toward(0.8));
    EXPECT_LT((mean.elasticity.stiffness() - expected).norm(), 1e-6 * expected.norm());
}

TEST(UnitGrain, MissingRadialDirectionIsRefused) {
    Scene scene = plate(0.0, PlaneCondition::strain);
    scene.specimen.radial.reset();
    EXPECT_THROW(MaterialMap{scene}, InputError);
}

// --- Transition wood

TEST(UnitTransitionWood, FollowsTheDensity) {
    Material early = wood({800e6, 100e6, 20e6, 0.3, 8e9, 0.4, 0.4}), late = wood({2000e6, 1500e6, 300e6, 0.4, 20e9, 0.45, 0.5});
    early.density = 300;
    late.density = 750;
    late.toughness = 500;
    const Material middle = transition_wood(early, late, {}, 0.5);
    const double rho = 525, cubes = (std::pow(rho, 3) - std::pow(300, 3)) / (std::pow(750, 3) - std::pow(300, 3));
    EXPECT_DOUBLE_EQ(middle.density, rho);
    EXPECT_NEAR(middle.orthotropic->E_R, 1400e6, 1e-3);
    EXPECT_NEAR(middle.orthotropic->E_T, 100e6 + 1400e6 * cubes, 1e-3);
    EXPECT_NEAR(middle.orthotropic->nu_RT, 0.35, 1e-15);
    EXPECT_NEAR(middle.toughness, 200 * std::pow(rho / 300, std::log(2.5) / std::log(2.5)), 1e-9);
    DensityExponents exponents;
    exponents.E_T = 1.0;
    exponents.toughness = 2.0;
    const Material other = transition_wood(early, late, exponents, 0.5);
    EXPECT_NEAR(other.orthotropic->E_T, 800e6, 1e-3);
    EXPECT_NEAR(other.toughness, 200 + 300 * (rho * rho - 9e4) / (5.625e5 - 9e4), 1e-9);
    for (const double grade : {0.0, 1.0}) {
        const Material& end = grade == 0.0 ? early : late;
        EXPECT_DOUBLE_EQ(transition_wood(early, late, {}, grade).orthotropic->E_T, end.orthotropic->E_T);
    }
}

// --- Paths

// Where a crack goes does not hang on the steps in which it grows, nor does it follow the grain unless it is driven to: wood off
// its axes opens obliquely by K_I alone.
TEST(VerificationOrthotropicPath, HangsNotOnTheAdvance) {
    for (const double grain : {30.0, 60.0}) {
        std::vector<double> heights;
        for (const double advance : {2e-3, 1.0e-3, 0.6e-3, 0.0}) {
            Scene scene = at_equilibrium(block({20e-3, 20e-3}, 0.5e-3));
            scene.materials["EW"] = wood();
            scene.specimen.radial = grain * degree;
            scene.edges = {moving("top", Side::top, {0.0, 1e-5}), moving("bottom", Side::bottom, {0.0, 0.0})};
            scene.edges[0].velocity[0].reset();
            scene.cracks = {Crack{}};
            scene.cracks[0].points = {Vec2(0.0, 10.06e-3), Vec2(5e-3, 10.06e-3)};
            scene.cracks[0].grows = Growth::end;
            scene.cracks[0].advance = advance;
            scene.measure = {"top", "top"};
            scene.stop.displacement = 5e-3;
            scene.stop.crack_length = 10e-3;
            const std::vector<Vec2> path = simulate(scene).paths[0];
            double height = 0.0;
            for (std::size_t k = 1; k < path.size(); ++k)
                if (path[k - 1].x() <= 9e-3 && path[k].x() > 9e-3)
                    height = std::lerp(path[k - 1].y(), path[k].y(), (9e-3 - path[k - 1].x()) / (path[k].x() - path[k - 1].x()));
            std::printf("grain at %.0f degrees, advance %.1f mm: 4 mm on, the crack is at y = %.3f mm\n", grain, 1e3 * advance,
                        1e3 * height);
            heights.push_back(height);
        }
        for (const double height : heights) EXPECT_NEAR(height, heights[0], 0.15e-3) << grain;
    }
}

// --- Explicit dynamics

TEST(SystemOrthotropicDynamics, KeepsItsEnergy) {
    Scene scene = ring_specimen(3e-3, 0.5e-3);
    scene.specimen.rings->pith = {-6e-3, 1e-3};
    scene.materials["EW"] = wood();
    scene.materials["LW"] = wood({2400e6, 3000e6, 300e6, 0.35, 20e9, 0.4, 0.45});
    scene.solver.damping = 0.0;
    Trial trial(scene);
    ASSERT_FALSE(trial.plan.quasistatic);
    trial.until(3e-4);
    const EnergyBooks books = trial.solver.energies();
    const double imbalance = (books.work - books.strain - books.kinetic) / books.work;
    std::printf("explicit, %.1f ns steps: energy off by %.1e of the work\n", 1e9 * trial.plan.time_step, imbalance);
    EXPECT_LT(std::abs(imbalance), 1e-3);
}

}  // namespace
}  // namespace crampfit::test
