#include "imaging/segment.hpp"

#include "datasets/error.hpp"
#include "imaging/border_directions.hpp"
#include "imaging/flatten.hpp"
#include "imaging/foreign.hpp"
#include "imaging/gray_picture.hpp"
#include "imaging/growth.hpp"
#include "imaging/pith.hpp"
#include "imaging/pixels.hpp"
#include "imaging/quantile.hpp"
#include "imaging/resolution_tag.hpp"
#include "imaging/ring_figures.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>

namespace crampfit {
namespace {

constexpr double least_coherency = 0.25;      // of the picture; noise has some 0.1
constexpr int least_side = 16;                // pixels
constexpr std::size_t most_pixels = 1 << 26;  // some hundred bytes are needed for each

// Where the brightest pixel is brighter by this factor than this share of all, it and the like are glints or hot pixels.
constexpr double glint = 1.25, usual_share = 0.999;
constexpr double least_ring = 15, least_latewood = 4;  // pixels; narrower, and LW fractions are off by more than 2 %
constexpr double most_void = 0.5;                      // of the picture: more is worth a warning
constexpr double most_beyond = 0.01;                   // of the wood: a density table is short of so many of its grays

/// Gray and colour as float, the brightest value 1, but for a few pixels.
struct Pixels {
    cv::Mat gray;
    cv::Mat bgr;  // empty: the picture is gray
};

Pixels read_float(const std::filesystem::path& image, const PictureKey& key) {
    const auto fail = [&](const std::string& rule) { throw InputError(key.file, key.key, image.string(), rule); };
    const cv::Mat stored = read_pixels(image, key);
    if (std::min(stored.rows, stored.cols) < least_side)
        fail(fmt::format("is {} x {} pixels: at least {} a side are needed", stored.cols, stored.rows, least_side));
    if (stored.total() > most_pixels)
        fail(fmt::format("is {} x {} pixels: at most 2^26 can be segmented", stored.cols, stored.rows));
    Pixels pixels;
    cv::Mat gray = stored;
    if (stored.channels() == 3) cv::cvtColor(stored, gray, cv::COLOR_BGR2GRAY);
    double darkest = 0, brightest = 0;
    cv::minMaxLoc(gray, &darkest, &brightest);
    if (!(brightest > darkest))
        fail(brightest > 0 ? "shows nothing: all pixels are equally bright" : "shows nothing: all pixels are black");
    gray.convertTo(pixels.gray, CV_32F);
    const double usual = quantile({pixels.gray.begin<float>(), pixels.gray.end<float>()}, usual_share);
    if (usual > darkest && brightest > glint * usual) brightest = usual;  // else nearly all is as dark as the darkest
    pixels.gray = cv::min(pixels.gray / brightest, 1.0);
    if (stored.channels() == 3) stored.convertTo(pixels.bgr, CV_32FC3, 1 / brightest);
    return pixels;
}

/// 255 where no specimen is photographed.
cv::Mat blank_of(const Pixels& pixels) { return find_blank(pixels.gray, pixels.bgr) | find_ground(pixels.gray); }

/// Across the rings; where there is no whole one, `along_growth` [pixels].
double typical_width(const std::vector<RingFigures>& rings, double along_growth) {
    std::vector<float> widths;
    for (const RingFigures& ring : rings) widths.push_back(static_cast<float>(ring.width));
    return rings.empty() ? along_growth : quantile(std::move(widths), 0.5);
}

/// Says where rings are too narrow for their LW fractions.
void warn_of_narrow(const std::vector<RingFigures>& rings, std::vector<std::string>& notes) {
    std::vector<float> widths, late;
    for (const RingFigures& ring : rings) {
        widths.push_back(static_cast<float>(ring.width));
        late.push_back(static_cast<float>(ring.width * ring.latewood_fraction));
    }
    const double width = quantile(widths, 0.5), late_width = quantile(late, 0.5);
    const auto narrow = std::ranges::count_if(rings, [](const RingFigures& ring) {
        return ring.width < least_ring || ring.width * ring.latewood_fraction < least_latewood;
    });
    if (narrow > 0 && width >= least_ring && late_width >= least_latewood)
        notes.push_back(
            fmt::format("{} of {} rings are narrower than {:.0f} pixels or their LW than {:.0f}: their LW fractions are "
                        "rough",
                        narrow, rings.size(), least_ring, least_latewood));
    if (!rings.empty() && (width < least_ring || late_width < least_latewood))
        notes.push_back(fmt::format("rings are {:.1f} pixels wide and their LW {:.1f}, typically: LW fractions need {:.0f} and "
                                    "{:.0f}, take a finer picture",
                                    width, late_width, least_ring, least_latewood));
}

/// Everything found in one round.
struct Round {
    OrientationField orientation;
    std::vector<BorderLine> borders;
    cv::Mat degree;    // in the frame
    cv::Mat features;  // in the frame
    double ring_width = 0;
    std::string obstacle;  // to tracing rings; empty: none

    cv::Mat late() const { return degree > 0.5; }  // 255 where LW is
};

double shorter_side(cv::Size picture) { return std::min(picture.width, picture.height); }

/// Before anything is known.
OrientationScale first_scale(cv::Size picture) {
    const double window = std::clamp(shorter_side(picture) / 10, 6.0, 60.0);
    return {2, {window, window}};
}

/// Derivatives well within a ring, gathered over half a ring across the rings, where the next border is, and over less along
/// them, where they wave; or more where rings are fine: noise. Without a ring width the middle between fine and coarse.
OrientationScale scale_for(double ring_width, const GrowthFrame& frame) {
    if (!(ring_width > 0)) {
        const double window = std::clamp(shorter_side(frame.size()) / 25, 6.0, 60.0);
        return {2, {window, window}};
    }
    const double least = std::max(4.0, shorter_side(frame.size()) / 100);
    const double across = std::max(least, 0.5 * ring_width), along = std::max(least, std::min(0.1 * ring_width, 7.0));
    return {std::clamp(0.03 * ring_width, 1.0, 4.0), frame.across() ? cv::Size2d(across, along) : cv::Size2d(along, across)};
}

/// Why no rings can be traced; empty where they can.
std::string obstacle(const OrientationField& field, bool pith) {
    if (cv::mean(field.coherency)[0] < least_coherency) return "no rings: gray varies in all directions alike";
    if (pith) return "rings not traced: the pith lies in the picture; cut a piece out on one side of it";
    return "";
}

/// Throws InputError for two that cross or touch.
void refuse_crossing(const std::vector<BorderPolyline>& borders, const std::vector<BorderLine>& lines, const GrowthFrame& frame) {
    for (std::size_t i = 0; i < lines.size(); ++i)
        for (std::size_t j = i + 1; j < lines.size(); ++j) {
            bool above = false, below = false;
            for (int u = std::max(lines[i].first, lines[j].first); u < std::min(lines[i].end(), lines[j].end()); ++u) {
                const double apart = lines[j].at(u) - lines[i].at(u);
                above = above || apart >= 0;
                below = below || apart <= 0;
                if (!above || !below) continue;
                const cv::Point2d at = frame.to_picture({static_cast<double>(u), lines[i].at(u)});
                throw InputError("--borders", "ring", std::to_string(borders[j].ring),
                                 fmt::format("meets the border of ring {} at {:.0f},{:.0f} px: borders must not cross",
                                             borders[i].ring, at.x, at.y));
            }
        }
}

std::vector<BorderLine> lines_of(const std::vector<BorderPolyline>& borders, const GrowthFrame& frame) {
    std::vector<BorderLine> lines;
    for (const BorderPolyline& border : borders) lines.push_back(line_of(border, frame));
    refuse_crossing(borders, lines, frame);
    std::sort(lines.begin(), lines.end(), [](const BorderLine& a, const BorderLine& b) {
        const int begin = std::max(a.first, b.first), end = std::min(a.end(), b.end()), middle = (begin + end) / 2;
        for (int off = 0; off <= end - begin; ++off)
            for (const int u : {middle - off, middle + off})
                if (a.covers(u) && b.covers(u)) return a.at(u) < b.at(u);
        const auto at = [middle](const BorderLine& line) { return line.at(middle < line.first ? line.first : line.end() - 1); };
        return at(a) < at(b);
    });
    return lines;
}

// Looks at a picture in one light: until that changes by no more than this part of the brightest gray, and so often at most.
constexpr double same_light = 0.03;
constexpr int most_looks = 3;

/// `blank` is what is no specimen whatever else is found; `pith`: it lies in the picture.
Round look(const cv::Mat& gray, const cv::Mat& bgr, const cv::Mat& blank, const cv::Mat& valid, const GrowthFrame& frame,
           const OrientationField& orientation, bool pith, double ring_width, const std::vector<BorderPolyline>& given) {
    Round round;
    round.orientation = orientation;
    const RingCoordinate rings(round.orientation, frame);
    const StraightWood wood(gray, valid, rings);
    round.obstacle = obstacle(round.orientation, pith);
    if (!given.empty()) round.borders = lines_of(given, frame);
    else if (round.obstacle.empty()) round.borders = find_ring_borders(wood, valid, blank, rings, ring_width);
    round.ring_width = typical_ring_width(round.borders);
    const double width = round.ring_width > 0 ? round.ring_width : gray.rows / 10.0;
    const BorderEdges edges(gray, valid, round.borders, width);
    if (given.empty())
        for (BorderLine& border : round.borders) border.move(edges.place(), gray.rows);
    WoodLevels levels;
    round.degree = density_degree(wood, gray, valid, rings, round.borders, edges, width, levels);
    if (round.borders.size() < 2) {  // without a whole ring it is not known how dark LW is
        round.features = cv::Mat(gray.size(), CV_8U, cv::Scalar(static_cast<double>(Feature::wood)));
    } else {
        const cv::Mat around = rings.bend(wood.blurred_along(std::max(8.0, 0.5 * width)).gray);
        round.features = find_foreign({gray, bgr, around, rings.map(), levels, width});
    }
    round.features.setTo(static_cast<double>(Feature::background), blank);
    return round;
}

/// 1 where a pixel is not blank, float.
cv::Mat shown(const cv::Mat& blank) {
    cv::Mat counts;
    cv::Mat(blank == 0).convertTo(counts, CV_32F, 1.0 / 255);
    return counts;
}

GrowthAxis growth_of(const cv::Mat& gray, const cv::Mat& blank, const OrientationField& orientation,
                     const SegmentOptions& options, std::vector<std::string>& notes) {
    const GrowthGuess guess = guess_growth(gray, shown(blank), orientation);
    if (!options.growth) {
        notes.push_back(fmt::format("growth {}, by {}", name(guess.growth), guess.reason));
        return guess.growth;
    }
    const bool across_others =
        GrowthFrame(*options.growth, gray.size()).across() != GrowthFrame(guess.growth, gray.size()).across();
    if (*options.growth != guess.growth && (guess.shown || across_others))
        notes.push_back(fmt::format("growth {} as told, though the picture looks like {}, by {}", name(*options.growth),
                                    name(guess.growth), guess.shown ? guess.reason : "the rings' direction"));
    return *options.growth;
}

/// A picture as it is stored.
struct View {
    cv::Mat gray, bgr;  // float
    cv::Mat blank;      // 255 where nothing is photographed

    View reduced(double factor) const {
        View small;
        cv::resize(gray, small.gray, {}, factor, factor, cv::INTER_AREA);
        if (!bgr.empty()) cv::resize(bgr, small.bgr, {}, factor, factor, cv::INTER_AREA);
        cv::resize(blank, small.blank, small.gray.size(), 0, 0, cv::INTER_NEAREST);
        return small;
    }
};

/// What the first round is for.
struct FirstLook {
    GrowthAxis growth = GrowthAxis::right;
    double ring_width = 0;  // [pixels]; 0: not found
    bool pith = false;      // seen
    cv::Mat valid;          // 1 where wood counts, in the frame
    cv::Mat late;           // 255 where LW is, in the frame
};

FirstLook look_first(const View& view, const SegmentOptions& options, std::vector<std::string>& notes) {
    const OrientationField orientation = measure_orientation(view.gray, view.blank == 0, first_scale(view.gray.size()));
    const GrowthAxis growth = growth_of(view.gray, view.blank, orientation, options, notes);
    const GrowthFrame frame(growth, view.gray.size());
    const cv::Mat bgr = view.bgr.empty() ? cv::Mat() : frame.turn(view.bgr), blank = frame.turn(view.blank);
    const bool pith = holds_pith(orientation);
    const Round round = look(frame.turn(view.gray), bgr, blank, shown(blank), frame, orientation, pith, 0, options.borders);
    return {growth, round.ring_width, pith, countable(round.features), round.late()};
}

/// Of a large picture some four million pixels tell as much as all, where rings are not too fine for that.
FirstLook look_first_at_some(const View& view, const SegmentOptions& options, std::vector<std::string>& notes) {
    constexpr double enough = 1 << 22, least_width = 12;  // pixels
    const double factor = std::sqrt(enough / static_cast<double>(view.gray.total()));
    if (factor < 1 && options.borders.empty()) {
        std::vector<std::string> small_notes;
        FirstLook look = look_first(view.reduced(factor), options, small_notes);
        if (look.ring_width > least_width) {
            notes.insert(notes.end(), small_notes.begin(), small_notes.end());
            look.ring_width /= factor;
            for (cv::Mat* map : {&look.valid, &look.late})
                cv::resize(*map, *map, GrowthFrame(look.growth, view.gray.size()).size(), 0, 0, cv::INTER_NEAREST);
            return look;
        }
    }
    return look_first(view, options, notes);
}

/// Directions in the picture from what is turned into the frame.
OrientationField orientation_in(const cv::Mat& gray, const cv::Mat& valid, const GrowthFrame& frame,
                                const OrientationScale& scale) {
    return measure_orientation(frame.turn_back(gray), frame.turn_back(valid) > 0, scale);
}

double pixel_of(const std::filesystem::path& image, const SegmentOptions& options, std::vector<std::string>& notes) {
    const std::optional<PixelTag> tag = pixel_by_tag(image);
    if (options.pixel > 0) {
        notes.push_back(fmt::format("scale: {:.6g} um a pixel, from {}", 1e6 * options.pixel, options.pixel_from));
        if (tag && !tag->square())
            notes.push_back("the file's resolution tag, " + tag->dots() + ", is of oblong pixels: taken as square, as told");
        return options.pixel;
    }
    if (tag && !tag->square())
        throw InputError(image.string(), "resolution tag", tag->dots(),
                         "pixels must be square: resample the picture, or give --pixel if the tag is wrong");
    if (tag) {
        notes.push_back(fmt::format("scale: {:.6g} um a pixel ({:.6g} dpi), from the file's resolution tag; check it",
                                    1e6 * tag->width, 0.0254 / tag->width));
        return tag->width;
    }
    notes.push_back("scale: not known (no --pixel, no resolution tag); widths in mm are nan and no scene can use the specimen");
    return 0;
}

void fill_maps(Specimen& specimen, const Round& round, const cv::Mat& classes, const GrowthFrame& frame) {
    const cv::Mat label = frame.turn_back(classes), feature = frame.turn_back(round.features);
    specimen.label.assign(label.begin<std::uint8_t>(), label.end<std::uint8_t>());
    specimen.feature.assign(feature.begin<std::uint8_t>(), feature.end<std::uint8_t>());
    for (std::size_t i = 0; i < specimen.label.size(); ++i) {
        const auto shown = static_cast<Feature>(specimen.feature[i]);
        if (shown == Feature::background || shown == Feature::crack) specimen.label[i] = Specimen::void_label;
    }
    const cv::Size size(specimen.columns, specimen.rows);
    const OrientationField& field = round.orientation;
    const cv::Mat c = field.full(field.cos2, size), s = field.full(field.sin2, size);
    const cv::Mat coherency = field.full(field.coherency, size);
    specimen.coherency.assign(coherency.begin<float>(), coherency.end<float>());
    specimen.orientation.reserve(specimen.label.size());
    for (int y = 0; y < size.height; ++y)
        for (int x = 0; x < size.width; ++x) {
            // The picture's y runs down, the specimen's up.
            const float angle = 0.5f * std::atan2(-s.at<float>(y, x), c.at<float>(y, x));
            specimen.orientation.push_back(angle < 0 ? angle + std::numbers::pi_v<float> : angle);
        }
}

/// As in an X-ray picture, by what the picture's own gray is told to stand for.
bool latewood_is_bright(const SegmentOptions& options) {
    if (options.density) return options.density->density.back() > options.density->density.front();
    const auto low = [&](const char* material) {
        const auto found = std::ranges::find(options.gray, material, &GrayClass::material);
        return found == options.gray.end() ? std::optional<int>() : std::optional<int>(found->low);
    };
    const auto early = low("EW"), late = low("LW");
    return early && late && *late > *early;
}

/// Classes towards LW by the picture's own gray; void where it lies in no range.
cv::Mat classes_by_gray(const std::filesystem::path& image, const SegmentOptions& options, std::vector<std::string>& names) {
    std::vector<GrayClass> ranges = options.gray;
    std::ranges::sort(ranges, std::greater{}, &GrayClass::low);
    if (latewood_is_bright(options)) std::ranges::reverse(ranges);
    std::array<std::uint8_t, 256> meaning;
    meaning.fill(Specimen::void_label);
    for (std::size_t i = 0; i < ranges.size(); ++i) {
        names.push_back(ranges[i].material);
        std::fill(meaning.begin() + ranges[i].low, meaning.begin() + ranges[i].high + 1, static_cast<std::uint8_t>(i));
    }
    const GrayPicture gray = read_gray(image, {"command line", "IMAGE"});
    cv::Mat classes(gray.rows, gray.columns, CV_8U);
    std::ranges::transform(gray.gray, classes.begin<std::uint8_t>(), [&](std::uint8_t value) { return meaning[value]; });
    return classes;
}

/// The radial direction as another picture of the wood shows it.
OrientationField orientation_of(const std::filesystem::path& image, cv::Size size, const OrientationScale& scale) {
    const PictureKey key{"command line", "--direction"};
    const Pixels pixels = read_float(image, key);
    if (pixels.gray.size() != size)
        throw InputError(key.file, key.key, image.string(),
                         fmt::format("is {} x {} pixels, the picture {} x {}: must have its size", pixels.gray.cols,
                                     pixels.gray.rows, size.width, size.height));
    return measure_orientation(pixels.gray, blank_of(pixels) == 0, scale);
}

/// Directions away from the pith, as told or as they fit it best.
void turn_from_pith(OrientationField& field, cv::Size picture, const SegmentOptions& options, std::vector<std::string>& notes) {
    if (options.pith) return turn_to_fan(field, fan_from({options.pith->x(), options.pith->y()}, picture));
    const std::optional<RadialFan> fan = fit_fan(field, picture);
    if (!fan) {
        notes.push_back("pith not fitted: the picture shows no directions");
        return;
    }
    turn_to_fan(field, *fan);
    const auto pith = fan->pith();
    const std::string where = pith ? fmt::format("fitted at {:.0f},{:.0f} px", pith->x, pith->y) : "nowhere: rings are straight";
    notes.push_back(fmt::format("pith {}; measured directions lie about those from it by {:.1f} degrees (standard deviation)",
                                where, 180 / std::numbers::pi * fan->scatter));
}

void fill_density(Specimen& specimen, const std::filesystem::path& image, const DensityTable& table,
                  std::vector<std::string>& notes) {
    const FinePicture gray = read_fine_gray(image, {"command line", "IMAGE"});
    std::vector<double> sum(specimen.classes.size(), 0.0);
    std::vector<long> count(sum.size(), 0);
    long wood = 0, beyond = 0;
    for (std::size_t i = 0; i < specimen.label.size(); ++i) {
        const std::uint8_t label = specimen.label[i];
        const double density = label == Specimen::void_label ? 0.0 : table.at(gray.gray[i]);
        specimen.density.push_back(static_cast<float>(density));
        if (label != Specimen::void_label) {
            ++wood;
            beyond += gray.gray[i] < table.gray.front() || gray.gray[i] > table.gray.back();
            sum[label] += density;
            ++count[label];
        }
    }
    for (std::size_t k = 0; k < sum.size(); ++k)
        if (count[k] > 0)
            notes.push_back(fmt::format("density of {}: {:.0f} kg/m^3 on average", specimen.classes[k],
                                        sum[k] / static_cast<double>(count[k])));
    if (const double share = static_cast<double>(beyond) / static_cast<double>(std::max(1l, wood)); share > most_beyond)
        notes.push_back(
            fmt::format("{:.0f} % of the wood has grays beyond the density table's, from {:.4g} to {:.4g}: taken for the "
                        "nearest row's density",
                        100 * share, table.gray.front(), table.gray.back()));
}

}  // namespace

void SegmentOptions::validate() const {
    const auto require = [](bool holds, const char* key, const std::string& value, const char* rule) {
        if (!holds) throw InputError("command line", key, value, rule);
    };
    require(pixel >= 0 && std::isfinite(pixel), "--pixel", fmt::format("{} m", pixel), "must be a positive length");
    require(classes == 2 || classes == 3, "--classes", std::to_string(classes), "must be 2 or 3");
    if (pith) require(pith->allFinite(), "--pith", fmt::format("{},{}", pith->x(), pith->y()), "must be a place in pixels");
    for (const GrayClass& range : gray) {
        const std::string text = fmt::format("{} {}-{}", range.material, range.low, range.high);
        require(range.low >= 0 && range.low <= range.high && range.high <= 255, "--gray", text,
                "must be 0 <= low <= high <= 255");
        for (const GrayClass& other : gray) {
            if (&other == &range) continue;
            require(range.high < other.low || other.high < range.low, "--gray", text, "ranges must not overlap");
            require(range.material != other.material, "--gray", text, "a class must have one range");
        }
    }
}

Segmentation segment(const std::filesystem::path& image, const SegmentOptions& options) {
    options.validate();
    if (options.threads > 0) cv::setNumThreads(options.threads);
    Segmentation result;
    const PictureKey key{"command line", "IMAGE"};
    const Pixels pixels = read_float(image, key);
    Specimen& specimen = result.specimen;
    specimen.columns = pixels.gray.cols;
    specimen.rows = pixels.gray.rows;
    specimen.source = image.string();
    specimen.pixel = pixel_of(image, options, result.notes);
    View view{pixels.gray, pixels.bgr, blank_of(pixels)};
    if (latewood_is_bright(options)) {
        view.gray = 1.0 - view.gray;
        result.notes.push_back("LW is the brighter wood, as told by --density or --gray");
    }
    const FirstLook first = look_first_at_some(view, options, result.notes);
    const GrowthFrame frame(first.growth, view.gray.size());
    const cv::Mat turned = frame.turn(view.gray), bgr = view.bgr.empty() ? cv::Mat() : frame.turn(view.bgr);
    const OrientationScale scale = scale_for(first.ring_width, frame);
    cv::Mat valid = first.valid, gray = flatten(turned, valid, first.late);
    Round second;
    for (int looks = 1;; ++looks) {
        const OrientationField orientation = orientation_in(gray, valid, frame, scale);
        const bool pith = first.pith && holds_pith(orientation);  // narrow windows see others in noise
        second = look(gray, bgr, frame.turn(view.blank), valid, frame, orientation, pith, first.ring_width, options.borders);
        const cv::Mat clearer = countable(second.features), flatter = flatten(turned, clearer, second.late());
        if (looks == most_looks || cv::norm(flatter, gray, cv::NORM_INF) < same_light * cv::norm(gray, cv::NORM_INF)) break;
        valid = clearer;  // LW that uneven light had hidden shows
        gray = flatter;
    }

    const double width = second.ring_width > 0 ? second.ring_width : gray.rows / 10.0;
    cv::Mat classes;
    if (options.gray.empty()) {
        specimen.classes =
            options.classes == 3 ? std::vector<std::string>{"EW", "transition", "LW"} : std::vector<std::string>{"EW", "LW"};
        classes = classify(second.degree, options.classes, width);
    } else {
        classes = frame.turn(classes_by_gray(image, options, specimen.classes));
    }
    if (!options.direction.empty()) second.orientation = orientation_of(options.direction, pixels.gray.size(), scale);
    if (options.fit_pith || options.pith) turn_from_pith(second.orientation, pixels.gray.size(), options, result.notes);
    else if (options.direction.empty()) turn_to_borders(second.orientation, second.borders, frame, width);
    fill_maps(specimen, second, classes, frame);
    if (const auto share = static_cast<double>(std::ranges::count(specimen.label, Specimen::void_label)) /
                           static_cast<double>(specimen.label.size());
        share > most_void)
        result.notes.push_back(
            fmt::format("{:.0f} % of the picture is void: taken for ground, cracks, or grays of no class; look at "
                        "the preview",
                        100 * share));
    if (options.density) fill_density(specimen, image, *options.density, result.notes);
    for (std::size_t i = 0; i < second.borders.size(); ++i)
        specimen.borders.push_back(polyline_of(second.borders[i], static_cast<std::int64_t>(i) + 1, frame));
    const auto latewood = std::ranges::find(specimen.classes, "LW");  // else the last class
    const auto number = std::min(latewood - specimen.classes.begin(), std::ssize(specimen.classes) - 1);
    specimen.rings = ring_figures(second.borders, classes, static_cast<int>(number), second.features);
    if (!second.obstacle.empty() && options.borders.empty()) result.notes.push_back(second.obstacle);
    std::string found = fmt::format("{} ring borders{}, {} rings between them", specimen.borders.size(),
                                    options.borders.empty() ? "" : " as given", specimen.rings.size());
    if (const double typical = typical_width(specimen.rings, second.ring_width); typical > 0)
        found += fmt::format(", typically {:.1f} pixels wide", typical);
    result.notes.push_back(std::move(found));
    warn_of_narrow(specimen.rings, result.notes);
    return result;
}

}  // namespace crampfit
