#include "datasets/record_file.hpp"

#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"

#include <fmt/format.h>

namespace crampfit {

using hdf5::Group;

const std::array<SeriesColumn, 13> series_columns{{
    {"time", "s", "time_s", "time in the scene", [](Instant& i) -> double& { return i.time; }},
    {"displacement", "m", "displacement_m", "motion of the measured edge or body",
     [](Instant& i) -> double& { return i.displacement; }},
    {"force", "N", "force_N", "reaction at the load cell, for the given thickness",
     [](Instant& i) -> double& { return i.force; }},
    {"crack_length", "m", "crack_length_m", "length of the tracked crack", [](Instant& i) -> double& { return i.crack_length; }},
    {"tip_x", "m", "tip_x_m", "tip of the tracked crack in the undeformed specimen",
     [](Instant& i) -> double& { return i.tip.x(); }},
    {"tip_y", "m", "tip_y_m", "tip of the tracked crack in the undeformed specimen",
     [](Instant& i) -> double& { return i.tip.y(); }},
    {"G", "J/m^2", "G_J_m2", "energy release rate at the tip", [](Instant& i) -> double& { return i.G; }},
    {"K_I", "Pa sqrt(m)", "K_I_Pa_sqrt_m", "stress intensity factor at the tip, opening",
     [](Instant& i) -> double& { return i.K_I; }},
    {"K_II", "Pa sqrt(m)", "K_II_Pa_sqrt_m", "stress intensity factor at the tip, sliding",
     [](Instant& i) -> double& { return i.K_II; }},
    {"strain_energy", "J", "strain_energy_J", "elastic energy of the specimen",
     [](Instant& i) -> double& { return i.strain_energy; }},
    {"kinetic_energy", "J", "kinetic_energy_J", "kinetic energy of the specimen",
     [](Instant& i) -> double& { return i.kinetic_energy; }},
    {"fracture_energy", "J", "fracture_energy_J", "energy spent on new crack faces",
     [](Instant& i) -> double& { return i.fracture_energy; }},
    {"external_work", "J", "external_work_J", "work done on the specimen by edges and bodies",
     [](Instant& i) -> double& { return i.external_work; }},
}};

const std::array<DrivingColumn, 5> driving_columns{{
    {"crack_length", "m", "crack_length_m", "length of the crack", &CriticalLoad::crack_length},
    {"displacement", "m", "displacement_m", "of the measured edge or body when it moves on", &CriticalLoad::displacement},
    {"force", "N", "force_N", "reaction at the load cell when it moves on", &CriticalLoad::force},
    {"G", "J/m^2", "G_J_m2", "energy release rate at the tip when it moves on", &CriticalLoad::G},
    {"toughness", "J/m^2", "toughness_J_m2", "mean toughness over the next advance", &CriticalLoad::toughness},
}};

std::size_t crack_number(const Record& record, std::size_t further) {
    return further < static_cast<std::size_t>(record.tracked_crack) ? further : further + 1;
}

namespace {

std::string numbered(std::size_t number) { return fmt::format("{:04}", number); }

void write_component(Group& group, const std::string& component, const std::vector<Vec2>& vectors, int axis,
                     const hdf5::Meaning& meaning) {
    std::vector<double> column;
    for (const Vec2& vector : vectors) column.push_back(vector[axis]);
    group.write(component, column, meaning);
}

std::vector<Vec2> read_components(const Group& group, const std::string& stem, std::size_t rows) {
    const std::vector<double> x = group.read_column<double>(stem + "_x", rows);
    const std::vector<double> y = group.read_column<double>(stem + "_y", rows);
    std::vector<Vec2> vectors(rows);
    for (std::size_t i = 0; i < rows; ++i) vectors[i] = {x[i], y[i]};
    return vectors;
}

// ---- series

void write_series(Group& root, std::vector<Instant> series) {
    Group group = root.make_group("series", "what was measured at each saved instant; the table `series`");
    for (const SeriesColumn& column : series_columns) {
        std::vector<double> values;
        for (Instant& instant : series) values.push_back(column.value(instant));
        group.write(column.name, values, {column.units, column.description});
    }
}

std::vector<Instant> read_series(const Group& group) {
    std::vector<Instant> series(group.read_column<double>(series_columns.front().name).size());
    for (const SeriesColumn& column : series_columns) {
        const std::vector<double> values = group.read_column<double>(column.name, series.size());
        for (std::size_t i = 0; i < series.size(); ++i) column.value(series[i]) = values[i];
    }
    return series;
}

// ---- cracks and reactions

void write_cracks(Group& root, const Record& record) {
    Group paths = root.make_group("paths", "each crack of the scene, in its order");
    for (std::size_t i = 0; i < record.paths.size(); ++i)
        paths.write(numbered(i), record.paths[i], {"m", "vertices x, y in the undeformed specimen, from start to end"});
    Group cracks = root.make_group("cracks", "every crack but the tracked one, row by row with the series");
    for (std::size_t i = 0; i < record.cracks.size(); ++i) {
        const CrackHistory& crack = record.cracks[i];
        Group group = cracks.make_group(numbered(i), fmt::format("the table `crack{}`", i + 1));
        group.write("crack_length", crack.length, {"m", "length of the crack"});
        write_component(group, "tip_x", crack.tip, 0, {"m", "tip in the undeformed specimen"});
        write_component(group, "tip_y", crack.tip, 1, {"m", "tip in the undeformed specimen"});
        group.write("G", crack.G, {"J/m^2", "energy release rate at the tip"});
        group.write("K_I", crack.K_I, {"Pa sqrt(m)", "stress intensity factor at the tip, opening"});
        group.write("K_II", crack.K_II, {"Pa sqrt(m)", "stress intensity factor at the tip, sliding"});
    }
}

void read_cracks(const Group& root, Record& record) {
    const std::size_t rows = record.series.size();
    const Group paths = root.group("paths");
    for (std::size_t i = 0; i < paths.size(); ++i) record.paths.push_back(paths.read_rows<double, 2>(numbered(i)));
    const Group cracks = root.group("cracks");
    for (std::size_t i = 0; i < cracks.size(); ++i) {
        const Group group = cracks.group(numbered(i));
        record.cracks.push_back({.length = group.read_column<double>("crack_length", rows),
                                 .tip = read_components(group, "tip", rows),
                                 .G = group.read_column<double>("G", rows),
                                 .K_I = group.read_column<double>("K_I", rows),
                                 .K_II = group.read_column<double>("K_II", rows)});
    }
}

void write_reactions(Group& root, const std::vector<ReactionHistory>& reactions) {
    Group all = root.make_group("reactions", "total force of each edge and body on the specimen, row by row with the series");
    for (std::size_t i = 0; i < reactions.size(); ++i) {
        Group group = all.make_group(numbered(i), "one edge or body");
        group.write_text("name", reactions[i].name, "name of the edge or body in the scene");
        write_component(group, "force_x", reactions[i].force, 0, {"N", "force on the specimen, for the given thickness"});
        write_component(group, "force_y", reactions[i].force, 1, {"N", "force on the specimen, for the given thickness"});
    }
}

void read_reactions(const Group& root, Record& record) {
    const Group all = root.group("reactions");
    for (std::size_t i = 0; i < all.size(); ++i) {
        const Group group = all.group(numbered(i));
        record.reactions.push_back({group.read_text("name"), read_components(group, "force", record.series.size())});
    }
}

// ---- crack driving

void write_driving(Group& root, const std::vector<CriticalLoad>& driving) {
    Group group =
        root.make_group("driving", "the load at which the crack moves on from each place of its way; the table `driving`");
    std::vector<Vec2> tips;
    for (const CriticalLoad& row : driving) tips.push_back(row.tip);
    write_component(group, "tip_x", tips, 0, {"m", "tip in the undeformed specimen"});
    write_component(group, "tip_y", tips, 1, {"m", "tip in the undeformed specimen"});
    for (const DrivingColumn& column : driving_columns) {
        std::vector<double> values;
        for (const CriticalLoad& row : driving) values.push_back(row.*column.value);
        group.write(column.name, values, {column.units, column.description});
    }
}

std::vector<CriticalLoad> read_driving(const Group& group) {
    std::vector<CriticalLoad> driving(group.read_column<double>("tip_x").size());
    const std::vector<Vec2> tips = read_components(group, "tip", driving.size());
    for (std::size_t i = 0; i < driving.size(); ++i) driving[i].tip = tips[i];
    for (const DrivingColumn& column : driving_columns) {
        const std::vector<double> values = group.read_column<double>(column.name, driving.size());
        for (std::size_t i = 0; i < driving.size(); ++i) driving[i].*column.value = values[i];
    }
    return driving;
}

// ---- points and frames

void write_points(Group& root, const Record& record) {
    Group points = root.make_group("points", "the material points of the frames");
    points.write("position", record.point_position, {"m", "x, y in the undeformed specimen"});
    points.write("size", std::vector<Vec2>{record.point_size}, {"m", "x, y of a point's rectangle, where nothing is cut off it"});
    points.write("latewood", record.point_latewood, {"1", "0 first material to 1 last material"});
    Group frames = root.make_group("frames", "the points at some instants");
    for (std::size_t i = 0; i < record.frames.size(); ++i) {
        const Frame& frame = record.frames[i];
        Group group = frames.make_group(numbered(i), "the points at one instant, in the order of points/position");
        group.write("time", frame.time, {"s", "time in the scene"});
        group.write("displacement", frame.displacement, {"m", "motion of the measured edge or body"});
        group.write("moved", frame.moved, {"m", "displacement x, y of each point"});
        group.write("stress", frame.stress, {"Pa", "stress xx, yy, xy, zz at each point"});
        group.write("crack", frame.crack, {"m", "vertices x, y of the first crack in the undeformed specimen"});
    }
}

void read_frames(const Group& root, Record& record) {
    const Group frames = root.group("frames");
    const std::size_t points = record.point_position.size();
    for (std::size_t i = 0; i < frames.size(); ++i) {
        const Group group = frames.group(numbered(i));
        record.frames.push_back({.time = group.read_number<double>("time"),
                                 .displacement = group.read_number<double>("displacement"),
                                 .moved = group.read_rows<float, 2>("moved", points),
                                 .stress = group.read_rows<float, 4>("stress", points),
                                 .crack = group.read_rows<double, 2>("crack")});
    }
}

RunStatus read_status(const Group& root) {
    const std::string text = root.read_text("status");
    for (const RunStatus status : {RunStatus::finished, RunStatus::split, RunStatus::interrupted, RunStatus::unstable})
        if (text == name(status)) return status;
    root.refuse("status", text, "must be finished, split, interrupted or unstable");
}

/// The tables rely on it, and on a path for each crack.
int read_tracked_crack(const Group& root, const Record& record) {
    const std::int64_t number = root.read_number<std::int64_t>("tracked_crack");
    if (number < 0 || number > static_cast<std::int64_t>(record.cracks.size()))
        root.refuse("tracked_crack", std::to_string(number), "must be the number of a crack");
    if (!record.cracks.empty() && record.paths.size() != record.cracks.size() + 1)
        root.refuse("paths", std::to_string(record.paths.size()), "must be one for each crack");
    return static_cast<int>(number);
}

Record read_all_but_frames(const Group& root) {
    Record record;
    record.status = read_status(root);
    record.message = root.read_text("message");
    record.series = read_series(root.group("series"));
    read_cracks(root, record);
    record.tracked_crack = read_tracked_crack(root, record);
    read_reactions(root, record);
    record.driving = read_driving(root.group("driving"));
    record.point_position = root.group("points").read_rows<double, 2>("position");
    if (root.group("points").has("size")) record.point_size = root.group("points").read_rows<double, 2>("size", 1)[0];
    record.point_latewood = root.group("points").read_column<float>("latewood", record.point_position.size());
    record.scene_text = root.read_text("scene_text");
    record.explanation = root.read_text("explanation");
    record.steps = root.read_number<std::int64_t>("steps");
    record.points = root.read_number<std::int64_t>("point_count");
    record.seconds = root.read_number<double>("seconds");
    record.worst_energy_imbalance = root.read_number<double>("worst_energy_imbalance");
    return record;
}

}  // namespace

void write(const Record& record, const std::filesystem::path& file) {
    hdf5::save(file, "record", [&](Group& root) {
        root.write_text("status", name(record.status), "how the run ended");
        root.write_text("message", record.message, "why the run ended");
        root.write_text("scene_text", record.scene_text, "the scene in TOML as it was used");
        root.write_text("explanation", record.explanation, "what was modelled, by which solver, and why");
        root.write<std::int64_t>("tracked_crack", record.tracked_crack,
                                 {"1", "number in `paths` of the crack that the series follows"});
        root.write<std::int64_t>("steps", record.steps, {"1", "steps of the solver"});
        root.write<std::int64_t>("point_count", record.points, {"1", "material points"});
        root.write("seconds", record.seconds, {"s", "wall time of the run"});
        root.write("worst_energy_imbalance", record.worst_energy_imbalance,
                   {"1", "largest difference of work and energies, against the largest energy"});
        write_series(root, record.series);
        write_cracks(root, record);
        write_reactions(root, record.reactions);
        write_driving(root, record.driving);
        write_points(root, record);
    });
}

Record read_record_without_frames(const std::filesystem::path& file) { return read_all_but_frames(hdf5::open(file, "record")); }

Record read_record(const std::filesystem::path& file) {
    const Group root = hdf5::open(file, "record");
    Record record = read_all_but_frames(root);
    read_frames(root, record);
    return record;
}

}  // namespace crampfit
