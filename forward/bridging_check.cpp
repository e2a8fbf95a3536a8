#include "forward/bridging_check.hpp"

#include "datasets/error.hpp"
#include "forward/cracks.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace crampfit {

namespace {

// A crack that grows through a strip takes the energy of its bridges to 3 % with 7 to 22 cells in the length below, 5 to 9 % too
// much with 6, and several times as much with 3 (the scene of `VerificationBridging.GrowsAtTheEnergyOfTipAndBridges`).
constexpr double least_cells = 7.0;

// E' times the energy over the stress squared, by which faces soften along a crack (Hillerborg, Modeer and Petersson 1976), in
// the softest wood [m].
double softening_length(const Crack& crack, const MaterialMap& materials, const Discretisation& body) {
    const Bridging& law = *crack.faces.bridging;
    const std::size_t last = crack.points.size() - 1;
    const Vec2 along = (crack.points[last] - crack.points[last - 1]).normalized();
    double softest = std::numeric_limits<double>::infinity();
    for (int c = 0; c < body.layout.cells(); ++c)
        if (const int p = body.points.first_of_cell[c]; p < body.points.first_of_cell[c + 1])
            softest =
                std::min(softest, opening_modulus(materials, body.points.position[p], 0.5 * body.layout.point_size(), along));
    return softest * law.energy() / (law.stress * law.stress);
}

}  // namespace

void check_bridging(const Scene& scene, bool quasistatic, const MaterialMap& materials, const Discretisation& body) {
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const Crack& crack = scene.cracks[k];
        if (!crack.faces.bridging) continue;
        const std::string key = fmt::format("cracks.{}.faces.traction", k);
        if (quasistatic)
            throw InputError(
                scene.file.string(), key, fmt::format("{:g} MPa", crack.faces.bridging->stress * 1e-6),
                "is not available at equilibrium, where the energy that an advance releases is told from its two ends: faces "
                "that soften take some on the way; use solver.kind = \"explicit\", with a load that does not take long");
        const double cell = body.layout.cell.maxCoeff();
        const double cells = softening_length(crack, materials, body) / cell;
        if (crack.grows != Growth::none && cells < least_cells)
            throw InputError(
                scene.file.string(), key + ".opening", fmt::format("{:g} mm", crack.faces.bridging->opening * 1e3),
                fmt::format(
                    "with this stress and wood the faces of a growing crack soften over {:.2g} cells (E' energy / stress^2), "
                    "which needs {:g}: give model.cell = \"{:.2g} mm\" or less, a larger opening or a smaller stress",
                    cells, least_cells, 1e3 * cell * cells / least_cells));
    }
}

std::vector<Plan::Choice> bridging_choices(const Scene& scene, const MaterialMap& materials, const Discretisation& body) {
    std::vector<Plan::Choice> choices;
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const auto& law = scene.cracks[k].faces.bridging;
        if (!law) continue;
        const double cells = softening_length(scene.cracks[k], materials, body) / body.layout.cell.maxCoeff();
        choices.push_back(
            {fmt::format("bridging of {}", k),
             fmt::format("{:g} MPa falling to nothing at {:g} mm: {:.4g} J/m^2 beyond the toughness of the tip, on {} faces",
                         law->stress * 1e-6, law->opening * 1e3, law->energy(), law->on_all_faces ? "all" : "new"),
             fmt::format("asked for in cracks.{}.faces.traction; softens over about {:.2g} cells; G and K are those of the tip",
                         k, cells)});
    }
    return choices;
}

}  // namespace crampfit
