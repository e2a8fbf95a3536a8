#include "imaging/correlate.hpp"

#include "datasets/error.hpp"
#include "imaging/spreading.hpp"
#include "imaging/strain.hpp"

#include <fmt/format.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <limits>

namespace crampfit {
namespace {

constexpr int border = 6;  // pixels from the outermost subsets to the picture's edge: room for smoothing and small displacements

/// As many points as there is room for, with what is left over shared between both sides.
PointLattice lattice_of(const FinePicture& picture, const CorrelateOptions& options) {
    const auto along = [&](int count) {
        const int room = count - options.subset - 2 * border;
        return std::pair{room / options.step + 1, border + options.subset / 2 + room % options.step / 2};
    };
    const auto [columns, first_x] = along(picture.columns);
    const auto [rows, first_y] = along(picture.rows);
    return {columns, rows, first_x, first_y, options.step};
}

/// Sums over the subsets of a picture, by its summed-area table.
class SubsetSums {
  public:
    SubsetSums(const cv::Mat& picture, int half) : half_(half) { cv::integral(picture, table_, CV_64F); }

    double about(int x, int y) const {
        const int left = x - half_, right = x + half_ + 1, top = y - half_, bottom = y + half_ + 1;
        return table_.at<double>(bottom, right) - table_.at<double>(bottom, left) - table_.at<double>(top, right) +
               table_.at<double>(top, left);
    }

  private:
    int half_;
    cv::Mat table_;
};

/// Which points cannot be followed in any image, and why; the others are not reached yet.
std::vector<PointStatus> usable_points(const FinePicture& picture, const std::vector<std::uint8_t>& mask,
                                       const PointLattice& lattice, int subset, double least_deviation) {
    const cv::Mat all(picture.rows, picture.columns, CV_32F, const_cast<float*>(picture.gray.data()));
    const cv::Mat gray = all - cv::mean(all);  // small numbers, whose squares are exact enough
    const SubsetSums sum(gray, subset / 2), squares(gray.mul(gray), subset / 2);
    const cv::Mat inside = mask.empty() ? cv::Mat(gray.size(), CV_8U, cv::Scalar(255))
                                        : cv::Mat(picture.rows, picture.columns, CV_8U, const_cast<std::uint8_t*>(mask.data()));
    const SubsetSums masked(inside == 0, subset / 2);
    const double count = subset * subset;
    std::vector<PointStatus> usable;
    for (int point = 0; point < lattice.count(); ++point) {
        const int x = lattice.x(point), y = lattice.y(point);
        const double mean = sum.about(x, y) / count;
        const bool flat = squares.about(x, y) / count - mean * mean < least_deviation * least_deviation;
        usable.push_back(inside.at<std::uint8_t>(y, x) == 0 ? PointStatus::masked
                         : masked.about(x, y) > 0           ? PointStatus::across_mask
                         : flat                             ? PointStatus::no_contrast
                                                            : PointStatus::not_reached);
    }
    return usable;
}

/// A reference that can be followed.
FinePicture checked(FinePicture picture, const CorrelateOptions& options, const std::string& name) {
    if (const int least = options.subset + 2 * border; picture.columns < least || picture.rows < least)
        throw InputError("command line", "reference", name,
                         fmt::format("is {} x {} pixels; a subset of {} needs at least {} x {}", picture.columns, picture.rows,
                                     options.subset, least, least));
    if (has_one_gray(picture))
        throw InputError("command line", "reference", name,
                         fmt::format("has gray {} only: there is nothing to follow", picture.gray.front()));
    return picture;
}

/// Of an image that shows nothing, as a camera's dropped frame.
std::vector<SubsetMatch> lost_matches(const std::vector<PointStatus>& at_start) {
    std::vector<SubsetMatch> matches;
    for (const PointStatus status : at_start)
        matches.emplace_back().status = status == PointStatus::not_reached ? PointStatus::no_contrast : status;
    return matches;
}

/// A subset that reaches over a crack matches neither side, and yet may correlate well. It shows in what is left of its
/// grays, a few pixels left out: more than noise leaves elsewhere in the picture, and more than motion by `most_apart` makes of
/// the slopes.
void drop_torn(std::vector<SubsetMatch>& matches) {
    std::vector<double> residuals;
    for (const SubsetMatch& match : matches)
        if (match.status == PointStatus::ok) residuals.push_back(match.residual);
    if (residuals.empty()) return;
    const auto middle = residuals.begin() + static_cast<std::ptrdiff_t>(residuals.size() / 2);
    std::ranges::nth_element(residuals, middle);
    const double noise = *middle;
    for (SubsetMatch& match : matches)
        if (match.status == PointStatus::ok && match.apart > 2 * noise &&
            match.apart - noise > most_apart * most_apart * match.slope)
            match.status = PointStatus::moved_apart;
}

}  // namespace

void CorrelateOptions::validate() const {
    const auto fail = [](const char* option, int value, const char* rule) {
        throw InputError("command line", option, std::to_string(value), rule);
    };
    if (subset < 5 || subset > 501 || subset % 2 == 0) fail("--subset", subset, "must be an odd number of pixels from 5 to 501");
    if (step < 1 || step > 1000) fail("--step", step, "must be from 1 to 1000 pixels");
    if (order != 1 && order != 2) fail("--order", order, "must be 1 or 2");
    if (smoothing && !(*smoothing >= 0 && *smoothing <= 20))
        throw InputError("command line", "--smoothing", fmt::format("{}", *smoothing), "must be from 0 to 20 pixels");
}

bool has_one_gray(const FinePicture& picture) {
    const auto [least, most] = std::ranges::minmax_element(picture.gray);
    return *least == *most;
}

Correlator::Correlator(FinePicture reference, const std::vector<std::uint8_t>& mask, const CorrelateOptions& options,
                       const std::string& name)
    : options_(options), reference_(checked(std::move(reference), options, name), options.smoothing),
      lattice_(lattice_of(reference_.picture, options)),
      at_start_(usable_points(reference_.picture, mask, lattice_, options.subset, reference_.least_deviation)) {}

void Correlator::check(const FinePicture& image, const std::string& name) const {
    const FinePicture& reference = reference_.picture;
    if (image.columns != reference.columns || image.rows != reference.rows)
        throw InputError("command line", "image", name,
                         fmt::format("is {} x {} pixels, the reference {} x {}: all must have one size", image.columns,
                                     image.rows, reference.columns, reference.rows));
}

DisplacementField Correlator::field(const FinePicture& image) const {
    std::vector<SubsetMatch> matches = has_one_gray(image) ? lost_matches(at_start_)
                                                           : spread_matches(reference_, image, lattice_, at_start_,
                                                                            options_.subset, options_.order, options_.threads);
    drop_torn(matches);
    DisplacementField field;
    const double lost = std::numeric_limits<double>::quiet_NaN();
    for (const SubsetMatch& match : matches) {
        const bool ok = match.status == PointStatus::ok;
        field.u.push_back(ok ? match.warp.u[0] : lost);
        field.v.push_back(ok ? match.warp.v[0] : lost);
        field.zncc.push_back(ok ? match.zncc : lost);
        field.sigma.push_back(ok ? match.sigma : lost);
        field.status.push_back(match.status);
    }
    add_strain(lattice_, field);
    return field;
}

}  // namespace crampfit
