#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/keys.hpp"
#include "datasets/limits.hpp"
#include "datasets/scene_parts.hpp"
#include "datasets/text_file.hpp"
#include "datasets/toml_reader.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace crampfit {
namespace {

/// Names of all edges and bodies; each must be given once, since [measure] addresses both.
std::vector<std::string> check_names(const Scene& scene, const Entry& root) {
    std::vector<std::string> names;
    const auto add = [&](const std::string& name, const Entry& list, std::size_t number) {
        if (std::find(names.begin(), names.end(), name) != names.end()) {
            const Entry member = list.list()[number];
            (member.has("name") ? member.at("name") : member)
                .fail(fmt::format("the name \"{}\" is taken: each edge and body needs a name of its own", name));
        }
        names.push_back(name);
    };
    for (std::size_t i = 0; i < scene.edges.size(); ++i) {
        add(scene.edges[i].name, root.at("edges"), i);
    }
    for (std::size_t i = 0; i < scene.bodies.size(); ++i) {
        add(scene.bodies[i].name, root.at("bodies"), i);
    }
    return names;
}

/// What is measured where the scene does not say: the first edge or body that moves, else the first under a traction
/// or force, else the first.
std::string default_measure(const Scene& scene, const std::vector<std::string>& names) {
    for (const Edge& edge : scene.edges) {
        if (edge.velocity[0].value_or(0) != 0 || edge.velocity[1].value_or(0) != 0) {
            return edge.name;
        }
    }
    for (const Body& body : scene.bodies) {
        if (body.velocity != Vec2::Zero()) {
            return body.name;
        }
    }
    for (const Edge& edge : scene.edges) {
        if (edge.traction) {
            return edge.name;
        }
    }
    for (const Body& body : scene.bodies) {
        if (body.force != Vec2::Zero()) {
            return body.name;
        }
    }
    return names.front();
}

bool moves_at_start(const Scene& scene) {
    const auto& parts = scene.specimen.parts;
    return std::any_of(parts.begin(), parts.end(), [](const Part& part) { return !part.velocity.isZero(0.0); });
}

Measure read_measure(const Scene& scene, const Entry& root) {
    const std::vector<std::string> names = check_names(scene, root);
    const auto measure = root.find("measure");
    if (measure) {
        measure->only({"force", "displacement"});
    }
    const auto measured = [&](const char* key) {
        const auto entry = measure ? measure->find(key) : std::nullopt;
        if (!entry) {
            if (names.empty() && moves_at_start(scene)) {
                return std::string();
            }
            if (names.empty()) {
                throw InputError(scene.file.string(), std::string("measure.") + key, "(missing)",
                                 "there is no edge and no body: nothing loads the specimen");
            }
            return default_measure(scene, names);
        }
        const std::string name = entry->text();
        if (std::find(names.begin(), names.end(), name) == names.end()) {
            entry->fail("there is no edge or body of this name" + suggestion(name, names));
        }
        return name;
    };
    return {measured("force"), measured("displacement")};
}

}  // namespace

Model read_model(const Entry& entry) {
    entry.only({"plane", "thickness", "cell", "error", "points_per_cell"});
    Model model;
    model.plane =
        entry.at("plane").choice<PlaneCondition>({{"strain", PlaneCondition::strain}, {"stress", PlaneCondition::stress}});
    model.thickness = entry.at("thickness").number(limits::thickness);
    if (const auto error = entry.find("error")) {
        if (entry.find("cell")) {
            error->fail("give either the cell or the error that it is chosen for");
        }
        model.error = error->number(limits::asked_error);
    } else {
        model.cell = entry.at("cell").number(limits::cell);
    }
    if (const auto points = entry.find("points_per_cell")) {
        model.points_per_cell = points->integer(1, 25);
        bool square = false;
        for (int side = 1; side <= 5; ++side) {
            square = square || side * side == model.points_per_cell;
        }
        if (!square) {
            points->fail("must be a square number: 1, 4, 9, 16 or 25");
        }
    }
    return model;
}

namespace {

/// How an explicit step updates velocities and stresses.
void read_updates(const Entry& entry, SolverChoice& solver) {
    constexpr int highest_order = 100;
    if (const auto update = entry.find("velocity_update")) {
        solver.velocity_update = update->choice<VelocityUpdate>({{"auto", VelocityUpdate::automatic},
                                                                 {"flip", VelocityUpdate::flip},
                                                                 {"pic", VelocityUpdate::pic},
                                                                 {"xpic", VelocityUpdate::xpic},
                                                                 {"fmpm", VelocityUpdate::fmpm}});
    }
    if (const auto order = entry.find("order")) {
        if (solver.velocity_update != VelocityUpdate::xpic && solver.velocity_update != VelocityUpdate::fmpm) {
            order->fail("belongs to velocity_update = \"xpic\" or \"fmpm\"");
        }
        solver.order = order->integer(1, highest_order);
    }
    if (const auto share = entry.find("pic_share")) {
        if (solver.velocity_update != VelocityUpdate::flip) {
            share->fail("belongs to velocity_update = \"flip\"");
        }
        solver.pic_share = share->number(limits::share);
    }
    if (const auto stress = entry.find("stress_update")) {
        solver.stress_update = stress->choice<StressUpdate>(
            {{"first", StressUpdate::first}, {"last", StressUpdate::last}, {"average", StressUpdate::average}});
    }
}

}  // namespace

SolverChoice read_solver(const Entry& entry) {
    entry.only({"kind", "shape_function", "velocity_update", "order", "pic_share", "stress_update", "strain", "damping",
                "extrapolate", "time_step"});
    SolverChoice solver;
    if (const auto strain = entry.find("strain")) {
        solver.strain = strain->choice<StrainMeasure>({{"auto", StrainMeasure::automatic},
                                                       {"small", StrainMeasure::small},
                                                       {"finite rotation", StrainMeasure::finite_rotation}});
    }
    if (const auto kind = entry.find("kind")) {
        solver.kind = kind->choice<SolverKind>({{"auto", SolverKind::automatic},
                                                {"explicit", SolverKind::explicit_dynamics},
                                                {"quasistatic", SolverKind::quasistatic}});
    }
    if (const auto shape = entry.find("shape_function")) {
        solver.shape_function = shape->choice<ShapeFunction>({{"auto", ShapeFunction::automatic},
                                                              {"linear", ShapeFunction::linear},
                                                              {"gimp", ShapeFunction::gimp},
                                                              {"bspline2", ShapeFunction::bspline2},
                                                              {"cpdi", ShapeFunction::cpdi}});
    }
    read_updates(entry, solver);
    if (const auto extrapolate = entry.find("extrapolate")) {
        solver.extrapolate = extrapolate->boolean();
    }
    if (const auto damping = entry.find("damping")) {
        solver.damping = damping->number(limits::damping);
    }
    if (const auto step = entry.find("time_step")) {
        solver.time_step = step->number(limits::time_step);
    }
    return solver;
}

Stop read_stop(const Entry& entry) {
    entry.only({"displacement", "crack_length", "time"});
    const auto value = [&](const char* key, const Dimension& dimension) {
        const auto found = entry.find(key);
        return found ? std::optional(found->number(limits::positive(dimension))) : std::nullopt;
    };
    const Stop stop{value("displacement", dimension::length), value("crack_length", dimension::length),
                    value("time", dimension::time)};
    if (!stop.displacement && !stop.crack_length && !stop.time) {
        entry.fail("the run would never end: give displacement, crack_length or time");
    }
    return stop;
}

Output read_output(const Entry& entry) {
    constexpr int most_frames = 100'000;
    constexpr int most_samples = 10'000'000;
    entry.only({"frames", "samples"});
    Output output;
    if (const auto frames = entry.find("frames")) {
        output.frames = frames->integer(0, most_frames);
    }
    if (const auto samples = entry.find("samples")) {
        output.samples = samples->integer(1, most_samples);
    }
    return output;
}

Scene parse_scene(const std::string& text, const std::filesystem::path& file, const Overrides& overrides) {
    const Document document(text, file, overrides);
    const Entry root = document.root();
    if (const auto experiments = root.find("experiments")) {
        experiments->fail("is a key of a study, for `crampfit fit` and `sensitivity`: a scene is needed");
    }
    root.only({"title", "model", "specimen", "materials", "edges", "bodies", "cracks", "measure", "solver", "stop", "output"});
    Scene scene;
    scene.file = file;
    scene.text = document.text();
    if (const auto title = root.find("title")) {
        scene.title = title->text();
    }
    scene.model = read_model(root.at("model"));
    scene.materials = read_materials(root.at("materials"), scene.model.plane);
    scene.specimen = read_specimen_plan(root.at("specimen"), scene.materials);
    if (scene.model.cell > scene.specimen.size.minCoeff()) {
        root.at("model").at("cell").fail("the cell is larger than the specimen");
    }
    if (const auto edges = root.find("edges")) {
        scene.edges = read_edges(*edges, scene.specimen.size);
    }
    if (const auto bodies = root.find("bodies")) {
        scene.bodies = read_bodies(*bodies);
    }
    if (const auto cracks = root.find("cracks")) {
        scene.cracks = read_cracks(*cracks, scene.specimen.size);
    }
    scene.measure = read_measure(scene, root);
    if (const auto solver = root.find("solver")) {
        scene.solver = read_solver(*solver);
    }
    scene.stop = read_stop(root.at("stop"));
    if (scene.measure.displacement.empty() && !scene.stop.time) {
        root.at("stop").fail("without an edge or a body that moves the run ends by time alone: give time");
    }
    if (scene.stop.crack_length && scene.cracks.empty()) {
        root.at("stop").at("crack_length").fail("there is no crack");
    }
    if (const auto output = root.find("output")) {
        scene.output = read_output(*output);
    }
    return scene;
}

Scene read_scene(const std::filesystem::path& file, const Overrides& overrides) {
    return parse_scene(read_text(file), file, overrides);
}

}  // namespace crampfit
