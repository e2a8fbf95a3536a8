#include "inverse/stress_unit.hpp"

#include <algorithm>

namespace crampfit {
namespace {

bool loaded_by_displacements_alone(const Scene& scene) {
    return std::ranges::none_of(scene.edges, [](const Edge& edge) { return edge.traction.has_value(); }) &&
           std::ranges::none_of(scene.bodies, [](const Body& body) { return body.free[0] || body.free[1]; }) &&
           std::ranges::none_of(scene.cracks, [](const Crack& crack) { return crack.faces.bridging.has_value(); });
}

}  // namespace

std::vector<std::string> stress_keys(const Scene& scene) {
    std::vector<std::string> keys;
    if (!loaded_by_displacements_alone(scene)) {
        return keys;
    }
    for (const auto& [name, material] : scene.materials) {
        if (material.remembers()) {  // time, or a yield stress
            return {};
        }
        std::vector<const char*> of_material{"E"};
        if (material.orthotropic) {
            of_material = {"E_R", "E_T", "G_RT"};
            if (material.orthotropic->E_L != 0) {
                of_material.push_back("E_L");
            }
        }
        for (const char* key : of_material) {
            keys.push_back("materials." + name + "." + key);
        }
    }
    return keys;
}

void multiply_stress(Scene& scene, double factor) {
    for (auto& [name, material] : scene.materials) {
        material.toughness *= factor;
        material.youngs_modulus *= factor;
        if (material.orthotropic) {
            OrthotropicElasticity& moduli = *material.orthotropic;
            for (double* modulus : {&moduli.E_R, &moduli.E_T, &moduli.G_RT, &moduli.E_L}) {
                *modulus *= factor;
            }
        }
    }
}

void multiply_stress(Record& record, double factor) {
    for (Instant& instant : record.series) {
        for (double Instant::*number : {&Instant::force, &Instant::G, &Instant::K_I, &Instant::K_II, &Instant::strain_energy,
                                        &Instant::kinetic_energy, &Instant::fracture_energy, &Instant::external_work}) {
            instant.*number *= factor;
        }
    }
    for (CrackHistory& crack : record.cracks) {
        for (std::vector<double> CrackHistory::*numbers : {&CrackHistory::G, &CrackHistory::K_I, &CrackHistory::K_II}) {
            for (double& number : crack.*numbers) {
                number *= factor;
            }
        }
    }
    for (ReactionHistory& reaction : record.reactions) {
        for (Vec2& force : reaction.force) {
            force *= factor;
        }
    }
    for (CriticalLoad& place : record.driving) {
        place.force *= factor;
        place.G *= factor;
        place.toughness *= factor;
    }
    for (Frame& frame : record.frames) {
        for (Eigen::Vector4f& stress : frame.stress) {
            stress *= static_cast<float>(factor);
        }
    }
}

}  // namespace crampfit
