#include "cli/picture_times.hpp"

#include "datasets/clock.hpp"
#include "datasets/error.hpp"
#include "datasets/limits.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit::cli {

namespace {

void check_times_of_images(const std::vector<double>& times, const std::filesystem::path& file) {
    for (std::size_t i = 0; i < times.size(); ++i)
        if (std::isnan(times[i]) || (i > 0 && times[i] < times[i - 1]))
            throw InputError(file.string(), fmt::format("time, row {}", i + 1), fmt::format("{} s", times[i]),
                             "times of the images must not fall, and have no gaps");
}

/// A row for each image, in their order, its times without gaps and not falling.
Curves read_times(const std::filesystem::path& file, std::size_t images) {
    Curves curves = read_curves(file);
    const std::vector<double>& times = curves.time.empty() ? curves.displacement : curves.time;
    if (times.size() != images)
        throw InputError(
            file.string(), "time", fmt::format("{} rows", times.size()),
            fmt::format("needs a column time [s] or displacement [mm] with a row for each of the {} images, in their order",
                        images));
    check_times_of_images(curves.time, file);
    return curves;
}

/// A load that was read as each image was taken: a row for each, in their order.
PictureInstants read_load_at_images(const std::filesystem::path& file, std::size_t images) {
    const Curves load = read_curves(file);
    const std::size_t rows = std::max({load.time.size(), load.displacement.size(), load.force.size()});
    if (rows != images)
        throw InputError(file.string(), "--load", fmt::format("{} rows", rows),
                         fmt::format("without --times it needs a row for each of the {} images, in their order", images));
    check_times_of_images(load.time, file);
    return {load.time, load.displacement, load.force, {}};
}

std::optional<double> number_of(const std::string& text, const NumberRule& rule, const char* option) {
    if (text.empty()) return std::nullopt;
    const double value = parse_quantity(text, rule.dimension, {"command line", option});
    if (!rule.allows(value)) throw InputError("command line", option, text, rule.rule);
    return value;
}

void check_load(const Curves& load, const std::filesystem::path& file) {
    if (load.time.empty()) throw InputError(file.string(), "time", "no such column", "the load needs its time");
    if (load.displacement.empty() && load.force.empty())
        throw InputError(file.string(), "", "", "needs a column displacement or force beside the time");
    for (std::size_t i = 0; i < load.time.size(); ++i)
        if (std::isnan(load.time[i]) || (i > 0 && !(load.time[i] > load.time[i - 1])))
            throw InputError(file.string(), fmt::format("time, row {}", i + 1), fmt::format("{} s", load.time[i]),
                             "times must rise from row to row, without gaps");
}

}  // namespace

void add_picture_times(CLI::App& verb, PictureTimes& times) {
    auto* table =
        verb.add_option("--times", times.times,
                        "Table with time [s] of each image, or displacement [mm] of the loading then, or both, a row an image")
            ->type_name("TIMES.csv");
    auto* load = verb.add_option("--load", times.load,
                                 "Table with time [s] and displacement [mm], force [N] or both, of the whole test; without "
                                 "--times a row an image")
                     ->type_name("LOAD.csv");
    auto* offset = verb.add_option("--offset", times.offset,
                                   "Of the images' time 0 on the load's clock, as in \"1.2 s\"; without it, and where "
                                   "both tables have a displacement or a force, the clocks are set by that")
                       ->type_name("TIME")
                       ->needs(table)
                       ->needs(load);
    verb.add_option("--trigger", times.trigger, "When the first image was taken, on the load's clock")
        ->type_name("TIME")
        ->needs(table)
        ->needs(load)
        ->excludes(offset);
    verb.add_option("--rate", times.rate, "Seconds of the load's clock in one of the images'")
        ->type_name("NUMBER")
        ->needs(table)
        ->needs(load);
}

PictureInstants read_picture_times(const PictureTimes& times, std::size_t images, const CommonOptions& common) {
    if (times.times.empty()) return times.load.empty() ? PictureInstants{} : read_load_at_images(times.load, images);
    const Curves taken = read_times(times.times, images);
    PictureInstants instants{taken.time, taken.displacement, taken.force, {}};
    if (times.load.empty()) return instants;
    if (taken.time.empty())
        throw InputError(times.times.string(), "time", "no such column", "a load is found by the images' time [s]");
    const Curves load = read_curves(times.load);
    check_load(load, times.load);
    const ClockChoice told{number_of(times.offset, limits::finite(dimension::time), "--offset"),
                           number_of(times.trigger, limits::finite(dimension::time), "--trigger"),
                           number_of(times.rate, limits::positive(dimension::number), "--rate")};
    const ClockSetting clock = set_clock(taken, load, told, times.times);
    for (double& time : instants.time) time = clock.offset + clock.rate * time;
    const auto apart =
        std::ranges::count_if(instants.time, [&](double time) { return std::isnan(load_at(load.time, load.time, time)); });
    if (apart == std::ssize(instants.time))
        throw InputError(
            times.times.string(), "time",
            fmt::format("{:.6g} to {:.6g} s on the load's clock", instants.time.front(), instants.time.back()),
            fmt::format("no image lies on the load's record, {:.6g} to {:.6g} s: set its clock with --offset or --trigger",
                        load.time.front(), load.time.back()));
    if (apart > 0)
        report(common,
               fmt::format("the load's record, {:.6g} to {:.6g} s, does not reach {} of {} images: no load is known at them",
                           load.time.front(), load.time.back(), apart, images));
    const auto at_images = [&](const std::vector<double>& column, std::vector<double>& to) {
        if (column.empty()) return;
        to.clear();
        for (const double time : instants.time) to.push_back(load_at(load.time, column, time));
    };
    at_images(load.displacement, instants.displacement);
    at_images(load.force, instants.force);
    instants.clock = clock;
    report(common, fmt::format("clocks: {}: load time = {:.6g} s + {:.8g} image time; {}", clock.reason, clock.offset, clock.rate,
                               clock.misalignment ? fmt::format("what is left is {:.3g} s a picture", *clock.misalignment)
                                                  : "how well is not known without a channel in both tables"));
    return instants;
}

}  // namespace crampfit::cli
