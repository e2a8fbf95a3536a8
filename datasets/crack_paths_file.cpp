#include "datasets/crack_paths_file.hpp"

#include <fmt/format.h>

namespace crampfit {

using hdf5::Group;

namespace {

struct DistanceColumn {
    const char* name;
    double SimulatedPath::*value;
    const char* description;
};

constexpr DistanceColumn distances[] = {
    {"mean_distance", &SimulatedPath::mean_distance, "of the photographed path from the simulated one, where both have gone"},
    {"largest_distance", &SimulatedPath::largest_distance,
     "of the photographed path from the simulated one, where both have gone"},
    {"compared_length", &SimulatedPath::compared_length, "of the photographed path, where both have gone"},
};

void write_simulated(Group& root, const SimulatedPath& simulated) {
    root.write_text("model", simulated.model, "value of the key that tells models apart; empty where none were compared");
    root.write_text("status", simulated.status, "how the run ended");
    for (const DistanceColumn& column : distances) root.write(column.name, simulated.*column.value, {"m", column.description});
    Group cracks = root.make_group("cracks", "each crack of the scene, in its order");
    for (std::size_t i = 0; i < simulated.cracks.size(); ++i)
        cracks.write(std::to_string(i), simulated.cracks[i],
                     {"m", "vertices x, y in the undeformed specimen, from start to end"});
}

SimulatedPath read_simulated(const Group& root) {
    SimulatedPath simulated{.model = root.read_text("model"), .status = root.read_text("status"), .cracks = {}};
    for (const DistanceColumn& column : distances) simulated.*column.value = root.read_number<double>(column.name);
    const Group cracks = root.group("cracks");
    for (std::size_t i = 0; i < cracks.size(); ++i) simulated.cracks.push_back(cracks.read_rows<double, 2>(std::to_string(i)));
    return simulated;
}

PlanePicture read_picture(const Group& root) {
    const auto [shape, gray] = root.read<std::uint8_t>("picture", {std::nullopt, std::nullopt});
    const std::vector<Vec2> corners = root.read_rows<double, 2>("corners", 2);
    if (gray.empty()) root.refuse("picture", "empty", "must have a pixel");
    if (!(corners[0].array() < corners[1].array()).all())
        root.refuse("corners", "no rectangle", "the lower left one must stand first");
    return {static_cast<int>(shape[1]), static_cast<int>(shape[0]), gray, corners[0], corners[1]};
}

}  // namespace

void write_crack_paths(Group& root, const std::vector<CrackPaths>& paths) {
    Group all =
        root.make_group("crack paths", "simulated and photographed, of each experiment; the tables `paths` and `path_distances`");
    for (std::size_t i = 0; i < paths.size(); ++i) {
        const CrackPaths& one = paths[i];
        Group group = all.make_group(std::to_string(i), "one experiment");
        group.write_text("experiment", one.experiment, "its name");
        group.write<std::uint8_t>("on_photograph", one.on_photograph,
                                  {"1", "1: the picture is a photograph; 0: the model's wood"});
        group.write("picture", one.picture.gray,
                    {static_cast<std::size_t>(one.picture.rows), static_cast<std::size_t>(one.picture.columns)},
                    {"1", "gray of the specimen, row 0 at the top"});
        group.write("corners", std::vector<Vec2>{one.picture.low, one.picture.high},
                    {"m", "lower left and upper right of the picture in the specimen"});
        group.write("photographed", one.photographed,
                    {"m", "vertices x, y of the photographed path in the undeformed specimen; none: not known"});
        Group simulated = group.make_group("simulated", "of each model, the best first");
        for (std::size_t k = 0; k < one.simulated.size(); ++k) {
            Group model = simulated.make_group(std::to_string(k), "one model at its best parameters");
            write_simulated(model, one.simulated[k]);
        }
    }
}

std::vector<CrackPaths> read_crack_paths(const Group& root) {
    std::vector<CrackPaths> paths;
    const Group all = root.group("crack paths");
    for (std::size_t i = 0; i < all.size(); ++i) {
        const Group group = all.group(std::to_string(i));
        CrackPaths& one = paths.emplace_back();
        one.experiment = group.read_text("experiment");
        one.on_photograph = group.read_number<std::uint8_t>("on_photograph") != 0;
        one.picture = read_picture(group);
        one.photographed = group.read_rows<double, 2>("photographed");
        const Group simulated = group.group("simulated");
        for (std::size_t k = 0; k < simulated.size(); ++k)
            one.simulated.push_back(read_simulated(simulated.group(std::to_string(k))));
    }
    return paths;
}

}  // namespace crampfit
