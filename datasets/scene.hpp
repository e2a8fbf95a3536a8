#pragma once

#include "datasets/specimen.hpp"

#include <Eigen/Core>

#include <array>
#include <filesystem>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

namespace crampfit {

using Vec2 = Eigen::Vector2d;

struct Circle {
    Vec2 centre;    // [m]
    double radius;  // [m]
};

struct Polygon {
    std::vector<Vec2> points;  // [m], at least three, either sense, closed by itself
};

using Shape = std::variant<Polygon, Circle>;

enum class PlaneCondition { strain, stress };

struct Model {
    PlaneCondition plane = PlaneCondition::strain;
    double thickness = 0.0;   // [m]
    double cell = 0.0;        // grid spacing [m]; 0: to be chosen so that `error` is met
    int points_per_cell = 4;  // a square number: 1, 4, 9, 16
    double error = 0.0;       // asked for in place of the cell, relative
};

/// Growth rings from geometry: with r the distance to the pith, LW where frac(r / period) > 1 - latewood_fraction.
/// Over `transition` before that, density goes linearly from EW to LW and the other properties follow the density.
struct Rings {
    Vec2 pith;                     // [m]
    double period = 0.0;           // [m]
    double latewood_fraction = 0;  // 0..1
    double transition = 0.0;       // [m]
};

struct GrayClass {
    std::string material;
    int low = 0;   // 0..255, inclusive
    int high = 0;  // 0..255, inclusive
};

/// A picture that becomes the specimen's material, and how it lies in the specimen.
struct Picture {
    std::filesystem::path file;  // resolved against the scene's folder
    double pixel = 0.0;          // [m]
    Vec2 offset = Vec2::Zero();  // the picture's lower left corner in the specimen [m]
    double rotation = 0.0;       // turns the picture about that corner, counter-clockwise [rad]
    std::vector<GrayClass> classes;
    bool graded = false;                // key `between = "graded"`: grays between two classes' ranges are transition wood
    std::filesystem::path orientation;  // optional second picture; empty: none
};

/// How the constants of transition wood follow its density between the two classes that it joins: linearly in density^exponent,
/// so that the law meets both ends. Without an exponent: density^n with the n that joins the ends. Poisson's ratios go linearly.
/// Defaults for E_R and E_T fit spruce (Jernkvist and Thuvander 2001, Moden and Berglund 2008); E_L and G_RT go with the stretch
/// and the bend of cell walls (Gibson and Ashby 1997, ch. 10).
struct DensityExponents {
    std::optional<double> E;  // of isotropic wood
    double E_R = 1.0;
    double E_T = 3.0;
    double G_RT = 3.0;
    double E_L = 1.0;
    std::optional<double> toughness;
};

/// A piece of the specimen that is on its own.
struct Part {
    Shape shape;
    Vec2 velocity = Vec2::Zero();  // at the start [m/s]
};

struct SpecimenPlan {
    Vec2 size = Vec2::Zero();  // lower left corner at the origin [m]
    std::vector<Shape> cutouts;
    std::vector<Part> parts;  // empty: all of the rectangle is one piece at rest; else nothing of it lies outside them
    std::string material;     // one of `material`, `rings`, `picture`, `file` is set
    std::optional<Rings> rings;
    std::optional<Picture> picture;
    std::filesystem::path file;       // a Specimen in HDF5; uses picture_offset and picture_rotation below
    Vec2 file_offset = Vec2::Zero();  // [m]
    double file_rotation = 0.0;       // [rad]
    std::optional<double>
        radial;                // the radial direction, where neither rings nor a map give it: counter-clockwise from +x [rad];
    std::optional<Vec2> pith;  // or away from here [m]
    DensityExponents density_exponents;
    std::shared_ptr<const Specimen> map;  // what `picture` or `file` holds, once it has been read
};

/// Elastic constants of wood along its own axes: L along the stem, R from the pith to the bark, T along the rings. The first
/// index of a Poisson's ratio is the direction of the stress, the second that of the contraction: nu_ij = -strain_j / strain_i
/// under stress along i, so that nu_ij / E_i = nu_ji / E_j (Kollmann and Cote 1968). Specimens lie in the R-T plane; the L
/// constants count in plane strain alone.
struct OrthotropicElasticity {
    double E_R = 0.0;   // [Pa]
    double E_T = 0.0;   // [Pa]
    double G_RT = 0.0;  // [Pa]
    double nu_RT = 0.0;
    double E_L = 0.0;  // [Pa]; 0 with nu_LR and nu_LT: not given
    double nu_LR = 0.0;
    double nu_LT = 0.0;
};

struct BrokenRule {
    std::string key;   // of the constant at fault
    std::string rule;  // that it breaks, in words
};

/// The thermodynamic limit that the constants break, if any: strain energy is positive whatever the strain (Lempriere 1968,
/// nu_ij^2 < E_i / E_j and a positive determinant). Without L constants the limit of the R-T plane alone.
std::optional<BrokenRule> broken_rule(const OrthotropicElasticity& wood);

/// A part of the moduli that relaxes with a time of its own.
struct PronyTerm {
    double g = 0.0;    // part of the instantaneous shear modulus
    double k = 0.0;    // part of the instantaneous bulk modulus
    double tau = 0.0;  // relaxation time [s]
};

/// Linear viscoelasticity: G(t) = G [1 - sum g (1 - exp(-t / tau))], the bulk modulus alike with k. The material's E and nu are
/// the instantaneous ones.
struct Viscoelasticity {
    std::vector<PronyTerm> prony;  // at least one; the sums of g and of k are below 1
};

/// J2 plasticity with isotropic hardening (Voce 1948): at the equivalent plastic strain a the wood flows at
/// yield_stress + hardening a + (saturation_stress - yield_stress) (1 - exp(-a / saturation_strain)).
struct Plasticity {
    double yield_stress = 0.0;  // in tension [Pa]
    double hardening = 0.0;     // [Pa]
    struct Saturation {
        double stress = 0.0;  // not below the yield stress [Pa]
        double strain = 0.0;  // 63 % of the way to it are done at this plastic strain
    };
    std::optional<Saturation> saturation = {};
};

struct Material {
    double youngs_modulus = 0.0;                            // E [Pa]
    double poisson_ratio = 0.0;                             // nu, -1 < nu < 0.5
    double density = 0.0;                                   // rho [kg/m^3]
    double toughness = 0.0;                                 // G_c [J/m^2]
    std::optional<OrthotropicElasticity> orthotropic = {};  // in place of E and nu
    std::optional<Viscoelasticity> viscoelastic = {};
    std::optional<Plasticity> plastic = {};

    bool remembers() const { return viscoelastic || plastic; }  // stress hangs on the way to a strain
};

/// What is wrong with numbers of a material that each are allowed, if anything.
std::optional<BrokenRule> broken_rule(const Material& material);

enum class Side { top, bottom, left, right };

/// A condition on a straight side of the specimen's rectangle.
struct Edge {
    std::string name;
    Side side = Side::top;
    std::optional<std::pair<double, double>> range;  // by x or y [m]; absent: the whole side
    std::array<std::optional<double>, 2> velocity;   // [m/s]; absent component: free
    std::optional<Vec2> traction;                    // [Pa]; excludes velocity
    std::optional<double> until;                     // moves until then, then holds still [s]
};

struct Contact {
    enum class Kind { frictionless, bonded, friction } kind = Kind::frictionless;
    double coefficient = 0.0;  // Coulomb friction
};

/// A rigid body.
struct Body {
    std::string name;
    Shape shape;
    Contact contact;
    Vec2 velocity = Vec2::Zero();            // [m/s]; nothing in a free component
    std::optional<double> until;             // moves until then, then holds still [s]
    std::array<bool, 2> free{false, false};  // components that follow the force
    Vec2 force = Vec2::Zero();               // on the body in its free components, from the start on [N]; nothing in the others
};

enum class Growth { none, start, end, both };
enum class GrowthDirection { normal_to_opening, hoop_stress, energy_release_rate, straight };

/// What still pulls open faces together, along the crack's normal (fibre bridging, process zone; linear softening after
/// Hillerborg, Modeer and Petersson 1976): `stress` (1 - d / `opening`) at the largest opening d so far, nothing from `opening`
/// on. Where they close again it falls in proportion to the opening.
struct Bridging {
    double stress = 0.0;        // of faces that begin to open [Pa]
    double opening = 0.0;       // at which it ends [m]
    bool on_all_faces = false;  // also on those that the crack has at the start; else where it grows

    double energy() const { return 0.5 * stress * opening; }  // that it takes in all [J/m^2]
};

struct CrackFaces {
    enum class Kind { frictionless, stick, friction } kind = Kind::frictionless;
    double coefficient = 0.0;
    std::optional<Bridging> bridging = {};
};

struct Crack {
    std::vector<Vec2> points;  // [m], at least two
    Growth grows = Growth::none;
    double advance = 0.0;  // material length over which energy is balanced [m]
    GrowthDirection direction = GrowthDirection::normal_to_opening;
    CrackFaces faces;
};

struct Measure {
    std::string force;         // an edge or a body
    std::string displacement;  // an edge or a body
};

enum class SolverKind { automatic, explicit_dynamics, quasistatic };
enum class ShapeFunction { automatic, linear, gimp, bspline2, cpdi };

enum class VelocityUpdate { automatic, flip, pic, xpic, fmpm };  // automatic: the grid keeps its velocities
enum class StressUpdate { first, last, average };
enum class StrainMeasure { automatic, small, finite_rotation };

struct SolverChoice {
    SolverKind kind = SolverKind::automatic;
    ShapeFunction shape_function = ShapeFunction::automatic;
    VelocityUpdate velocity_update = VelocityUpdate::automatic;
    int order = 2;           // of XPIC and FMPM
    double pic_share = 0.0;  // of PIC in FLIP, 0..1
    StressUpdate stress_update = StressUpdate::last;
    StrainMeasure strain = StrainMeasure::automatic;
    bool extrapolate = true;               // equilibrium: a second grid, twice as coarse, takes off most of the grid's error
    double damping = 0.0;                  // mass-proportional, force = -damping * mass * velocity [1/s]
    std::optional<double> time_step = {};  // of equilibrium with wood that remembers [s]; absent: chosen
};

/// Whichever comes first; at least one is set.
struct Stop {
    std::optional<double> displacement;  // [m]
    std::optional<double> crack_length;  // [m]
    std::optional<double> time;          // [s]
};

/// Places of the material whose displacement is asked for, at some instants of the loading.
struct Probes {
    std::vector<Vec2> places;      // undeformed [m]
    std::vector<double> instants;  // rising: times [s], or displacements of the measured edge or body [m]
    bool by_displacement = false;
    std::vector<double> weights = {1.0};  // a reading is the sum over so many places, one group after the other, weighed by these
};

struct Output {
    int frames = 0;      // pictures of the points
    int samples = 1000;  // rows of the series at most, about
    Probes probes;       // set by who compares with measured displacements, not by a file
};

/// Everything that a forward run needs. SI inside; checked by `read_scene` before anything runs.
struct Scene {
    std::string title;
    Model model;
    SpecimenPlan specimen;
    std::map<std::string, Material> materials;
    std::vector<Edge> edges;
    std::vector<Body> bodies;
    std::vector<Crack> cracks;
    Measure measure;
    SolverChoice solver;
    Stop stop;
    Output output;

    std::filesystem::path file;  // where it was read from
    std::string text;            // the TOML as it was used, overrides applied
};

}  // namespace crampfit
