#include "forward/memory_check.hpp"

#include "datasets/error.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace crampfit {

namespace {

void refuse(const Scene& scene, const std::string& key, const std::string& value, const std::string& rule) {
    throw InputError(scene.file.string(), key, value, rule);
}

// The ties at a tip are those of wood that has not relaxed: it must not while the tip passes them. With so many times the time
// that a Rayleigh wave takes to cross a cell halving the cell changes first growth by 1 %, with a tenth of it by 10 %.
constexpr double cells_in_relaxation = 500.0;

void check_relaxation_about_tips(const Scene& scene, const Discretisation& body) {
    for (const auto& [name, material] : scene.materials) {
        if (!material.viscoelastic) continue;
        const double speed = rayleigh_speed(plane_stiffness(material, scene.model.plane), material.density);
        const double least = cells_in_relaxation * body.layout.cell.maxCoeff() / speed;
        for (std::size_t i = 0; i < material.viscoelastic->prony.size(); ++i)
            if (const double tau = material.viscoelastic->prony[i].tau; tau < least)
                refuse(scene, fmt::format("materials.{}.prony.{}.tau", name, i), fmt::format("{:.3g} s", tau),
                       fmt::format("must be {:.3g} s or more on this grid where a crack grows: wood that relaxes while the tip "
                                   "passes a cell would "
                                   "make growth hang on the cell",
                                   least));
    }
}

}  // namespace

void check_memory(const Scene& scene, bool quasistatic, const MaterialMap& materials, const Discretisation& body) {
    if (scene.solver.time_step && !(quasistatic && materials.remembers()))
        refuse(scene, "solver.time_step", fmt::format("{:g} s", *scene.solver.time_step),
               "is for viscoelastic or plastic wood at equilibrium; leave it out: explicit dynamics steps as fast as waves go, "
               "and elastic wood "
               "at equilibrium needs no steps");
    if (!materials.remembers()) return;
    const bool plastic =
        std::any_of(materials.materials().begin(), materials.materials().end(), [](const Material& m) { return m.plastic; });
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const Crack& crack = scene.cracks[k];
        if (crack.grows == Growth::none) continue;
        const std::string key = "cracks." + std::to_string(k);
        const std::string grows = crack.grows == Growth::both ? "both" : crack.grows == Growth::end ? "end" : "start";
        if (quasistatic)
            refuse(scene, key + ".grows", grows,
                   "a crack in viscoelastic or plastic wood cannot grow at equilibrium: the energy that an advance releases "
                   "there is partly "
                   "dissipated by the wood about it, so that no balance of energy between two crack lengths says what the tip "
                   "takes up; use "
                   "\"none\", or for viscoelastic wood solver.kind = \"explicit\"");
        if (plastic)
            refuse(scene, key + ".grows", grows,
                   "a crack cannot grow in a specimen with plastic wood: what reaches the tip of a growing crack goes to zero "
                   "with the cell "
                   "there (Rice 1966), so that the grid would decide; use \"none\"");
        if (crack.advance > body.layout.cell.maxCoeff())
            refuse(scene, key + ".advance", fmt::format("{:g} mm", crack.advance * 1e3),
                   "not available beyond the cell with viscoelastic wood, whose energy over a longer advance hangs on how fast "
                   "the crack goes; "
                   "leave it out");
        if (crack.direction == GrowthDirection::hoop_stress || crack.direction == GrowthDirection::energy_release_rate)
            refuse(scene, key + ".direction",
                   crack.direction == GrowthDirection::hoop_stress ? "hoop stress" : "energy release rate",
                   "needs K, which is not known in viscoelastic wood; use \"normal to opening\" or \"straight\"");
        check_relaxation_about_tips(scene, body);
    }
}

}  // namespace crampfit
