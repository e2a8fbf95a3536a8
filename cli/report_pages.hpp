#pragma once

#include "datasets/crack_track.hpp"
#include "datasets/io.hpp"

#include <cstddef>
#include <filesystem>
#include <string>

/// The pages of `crampfit report`, one file a kind of result.
namespace crampfit::cli {

constexpr std::size_t most_picture_bytes = 2'000'000;  // of all figures of one kind together: a page stays below 5 MB

/// Where a result comes from.
struct Origin {
    std::filesystem::path file;
    std::string version;  // of the program that wrote it
    std::string created;  // as the file says it
};

std::string record_page(const Record& record, const Origin& origin);
std::string fit_page(const Fit& fit, const Origin& origin);
std::string sensitivity_page(const Sensitivity& sensitivity, const Origin& origin);
std::string specimen_page(const Specimen& specimen, const Origin& origin);
std::string field_page(const std::filesystem::path& file, const Origin& origin);  // read image by image
std::string track_page(const CrackTrack& track, const Origin& origin);

/// The specimen with the crack's path, and where there are frames a slider through them, the deformed specimen among them. The
/// frames shown are those of `shown_frames`.
std::string specimen_section(const Record& record);

/// Simulated crack paths of each experiment over the photographed one, or over the model's wood; empty where the fit has none.
std::string paths_section(const Fit& fit);

/// A length [m] for a table; a dash for what is no number.
std::string millimetres(double metres);

/// Numbers of the frames that a page shows: all, or a few dozen evenly spread from the first to the last.
std::vector<std::size_t> shown_frames(const Record& record);

/// The row of the series that a frame was taken at. The series has rows.
const Instant& instant_of(const Record& record, const Frame& frame);

/// The title in a scene or a study; the file's name where it has none.
std::string title_of(const std::string& toml, const Origin& origin);

/// The head of a page.
std::string heading(const std::string& title, const std::string& kind, const Origin& origin);

/// How to come to this result again: what to save as `input`, and the command with `settings` that the text does not hold.
std::string repeat_section(const std::string& toml, const std::string& verb, const std::string& input, const Origin& origin,
                           const std::string& settings = "");

}  // namespace crampfit::cli
