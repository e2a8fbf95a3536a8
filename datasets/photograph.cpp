#include "datasets/crack_track.hpp"
#include "datasets/limits.hpp"
#include "datasets/study_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {

Placement read_placement(const Entry& entry, const std::optional<double>& pixel, int rows) {
    const auto find = [&](const char* name) { return entry.is_table() ? entry.find(name) : std::nullopt; };
    Placement placement;
    placement.rows = rows;
    if (const auto given = find("pixel")) {
        constexpr double written = 1e-6;  // part of it that the digits leave open
        placement.pixel = given->number(limits::pixel);
        if (pixel && std::abs(placement.pixel - *pixel) > written * *pixel) {
            given->fail(fmt::format("contradicts the file, whose pixel is {:g} um: leave one of them out", 1e6 * *pixel));
        }
    } else if (pixel) {
        placement.pixel = *pixel;
    } else {
        entry.fail("the file does not know the edge of a pixel: give it as in { ..., pixel = \"10 um\" }");
    }
    if (const auto offset = find("offset")) {
        placement.offset = offset->point();
    }
    if (const auto rotation = find("rotation")) {
        placement.rotation = rotation->number(limits::rotation);
    }
    return placement;
}

Photograph read_photograph(const Entry& entry, const Scene& scene) {
    entry.only({"picture", "track", "pixel", "offset", "rotation"});
    Photograph photograph;
    if (const auto picture = entry.find("picture")) {
        photograph.file = picture->existing_file();
    }
    const auto file = entry.find("track");
    if (!file) {
        entry.at("picture");  // one of both must be there
        photograph.placement = read_placement(entry, {}, 0);
        return photograph;
    }
    photograph.track = file->existing_file();
    const CrackTrack track = read_crack_track(photograph.track);
    if (track.rows == 0) {
        file->fail("the file does not know the size of the pictures: track the crack again");
    }
    photograph.columns = track.columns;
    photograph.rows = track.rows;
    photograph.placement = read_placement(entry, track.pixel, track.rows);
    for (const Vec2& point : path_of(track)) {
        photograph.path.push_back(photograph.placement.place(point.x(), point.y()));
    }
    if (photograph.path.empty()) {
        file->fail("shows no crack in any image");
    }
    const Vec2& size = scene.specimen.size;
    const bool touches = std::ranges::any_of(photograph.path, [&](const Vec2& place) {
        return (place.array() >= 0.0).all() && (place.array() <= size.array()).all();
    });
    if (!touches) {
        entry.fail(fmt::format("the crack's path does not lie on the specimen, {:g} x {:g} mm: check pixel, offset and rotation",
                               1e3 * size.x(), 1e3 * size.y()));
    }
    return photograph;
}

}  // namespace crampfit
