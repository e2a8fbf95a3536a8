#include "imaging/border_line.hpp"

#include "imaging/quantile.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <iterator>
#include <limits>

namespace crampfit {
namespace {

constexpr double least_known = 0.3;  // share of a place's surroundings that must count
constexpr double least_rise = 0.4;   // of a border, against the others: of one that hardly shows, noise is the steepest
constexpr double edge = 3;           // rows at the end of what is photographed where no slope can be told

/// The way through `gain` [band x columns] that gathers most, moving at most one row a column and paying for each.
std::vector<int> best_way(const cv::Mat& gain) {
    // Of a row, against 1 for each column on the border: no stain is worth a turn, straightened rings hardly wave.
    constexpr float price = 3;
    cv::Mat sum = gain.clone(), from = cv::Mat::zeros(gain.size(), CV_8S);
    for (int u = 1; u < gain.cols; ++u) {
        for (int j = 0; j < gain.rows; ++j) {
            float best = sum.at<float>(j, u - 1);
            for (const int move : {-1, 1}) {
                if (j + move < 0 || j + move >= gain.rows || sum.at<float>(j + move, u - 1) - price <= best) continue;
                best = sum.at<float>(j + move, u - 1) - price;
                from.at<schar>(j, u) = static_cast<schar>(move);
            }
            sum.at<float>(j, u) += best;
        }
    }
    int j = 0;
    for (int i = 1; i < gain.rows; ++i)
        if (sum.at<float>(i, gain.cols - 1) > sum.at<float>(j, gain.cols - 1)) j = i;
    std::vector<int> way(gain.cols);
    for (int u = gain.cols - 1; u >= 0; --u) {
        way[u] = j;
        j += from.at<schar>(j, u);
    }
    return way;
}

/// The row of the steepest rise of a column next to a row, between rows; the row itself where there is none.
double steepest_near(const cv::Mat& slope, int u, int row) {
    const auto at = [&](int j) { return slope.at<float>(j, u); };
    int top = -1;
    for (int j = std::max(row - 1, 1); j <= std::min(row + 1, slope.rows - 2); ++j)
        if (at(j) > at(j - 1) && at(j) >= at(j + 1) && at(j) > (top < 0 ? 0.0f : at(top))) top = j;
    if (top < 0) return row;
    const double before = at(top - 1), here = at(top), after = at(top + 1);
    return top + 0.5 * (before - after) / (before - 2 * here + after);  // a parabola's top
}

/// The rows that a border is sought in: as many to either side of its guess.
struct Band {
    const std::vector<double>& guess;
    int reach;

    Band(const BorderGuess& border) : guess(border.row), reach(static_cast<int>(std::clamp(0.15 * border.room, 2.0, 15.0))) {}
    int columns() const { return static_cast<int>(guess.size()); }
    int height() const { return 2 * reach + 1; }
    int row(int u, int j) const { return static_cast<int>(std::lround(guess[u])) + j - reach; }

    /// What of a straightened picture lies in it [height x columns]; 0 beyond the picture.
    cv::Mat cut(const cv::Mat& straight) const {
        cv::Mat inside(height(), columns(), CV_32F, cv::Scalar(0));
        for (int u = 0; u < columns(); ++u)
            for (int j = 0; j < height(); ++j)
                if (row(u, j) >= 0 && row(u, j) < straight.rows) inside.at<float>(j, u) = straight.at<float>(row(u, j), u);
        return inside;
    }
};

/// The median over the columns of their steepest rise. Columns without any do not count, such as beside a specimen that is
/// narrower than its picture.
double usual_rise(const cv::Mat& slope) {
    cv::Mat highest;
    cv::reduce(slope, highest, 0, cv::REDUCE_MAX);
    std::vector<float> rises;
    std::copy_if(highest.begin<float>(), highest.end<float>(), std::back_inserter(rises), [](float rise) { return rise > 0; });
    return quantile(rises, 0.5);
}

/// Rows of the border in each column; `rise` is how steep it usually is.
std::vector<double> lay(const cv::Mat& slope, const std::vector<RowRange>& photographed, const Band& band, double rise) {
    constexpr float unseen = 0.4f;  // of the usual rise: more than noise has, so that a border may leave the picture
    cv::Mat gain = band.cut(slope) / rise;
    cv::min(cv::max(gain, 0), 1.5, gain);
    for (int u = 0; u < band.columns(); ++u)
        for (int j = 0; j < band.height(); ++j)
            if (!photographed[u].holds(band.row(u, j), edge)) gain.at<float>(j, u) = unseen;
    const std::vector<int> way = best_way(gain);
    cv::Mat rows(1, band.columns(), CV_32F);
    for (int u = 0; u < band.columns(); ++u) rows.at<float>(u) = static_cast<float>(steepest_near(slope, u, band.row(u, way[u])));
    cv::GaussianBlur(rows, rows, {0, 1}, 1.5, 1.5, cv::BORDER_REPLICATE);
    return {rows.begin<float>(), rows.end<float>()};
}

/// How gray rises down the columns of the finely straightened picture; 0 where that is not known. Where the LW of fine rings is
/// but a few pixels wide, smoothing would move its steepest side away from it.
cv::Mat slope_across(const StraightWood& wood, double room) {
    const StraightPicture fine = wood.blurred_along(2.0);
    const double sigma = std::clamp(0.04 * room, 0.3, 1.0);
    cv::Mat smooth, slope, unknown;
    cv::GaussianBlur(fine.gray, smooth, {1, 0}, sigma, sigma);
    cv::sepFilter2D(smooth, slope, CV_32F, cv::Mat::ones(1, 1, CV_32F), cv::Mat(cv::Vec3f(-0.5f, 0, 0.5f)));
    cv::dilate(fine.known < least_known, unknown, cv::Mat::ones(5, 1, CV_8U));
    slope.setTo(0, unknown);
    return slope;
}

/// A border in the frame from its rows in the straightened picture.
BorderLine in_frame(const std::vector<double>& row, const std::vector<RowRange>& photographed, const cv::Mat& valid,
                    const RingCoordinate& rings) {
    constexpr double beyond = std::numeric_limits<double>::infinity();
    const int columns = static_cast<int>(row.size());
    BorderLine line{.first = columns, .v = {}, .support = 0};
    std::vector<double> place(columns);
    int last = -1;
    for (int u = 0; u < columns; ++u) {
        if (!photographed[u].holds(row[u], edge)) {
            place[u] = row[u] < photographed[u].first + edge ? -beyond : beyond;
            continue;
        }
        place[u] = std::clamp(rings.v(u, rings.lowest() + row[u]), 0.0, valid.rows - 1.0);
        if (valid.at<float>(static_cast<int>(std::lround(place[u])), u) == 0) continue;
        line.first = std::min(line.first, u);
        last = u;
    }
    if (last >= line.first) line.v.assign(place.begin() + line.first, place.begin() + last + 1);
    return line;
}

}  // namespace

void BorderLine::move(double distance, int rows) {
    constexpr int reach = 5;  // columns to either side, that tell how steep it is
    const std::vector<double> before = v;
    const int count = static_cast<int>(v.size());
    for (int i = 0; i < count; ++i) {
        int a = i, b = i;
        while (a > std::max(0, i - reach) && std::isfinite(before[a - 1])) --a;
        while (b < std::min(count - 1, i + reach) && std::isfinite(before[b + 1])) ++b;
        const double slope = b > a ? (before[b] - before[a]) / (b - a) : 0;
        if (std::isfinite(before[i])) v[i] = std::clamp(before[i] + distance * std::hypot(1, slope), 0.0, rows - 1.0);
    }
}

double mean_distance(const BorderLine& inner, const BorderLine& outer) {
    double sum = 0;
    int count = 0;
    for (int u = std::max(inner.first, outer.first); u < std::min(inner.end(), outer.end()); ++u)
        if (inner.covers(u) && outer.covers(u)) {
            sum += outer.at(u) - inner.at(u);
            ++count;
        }
    return sum / std::max(count, 1);
}

std::vector<BorderLine> lay_borders(const StraightWood& wood, const cv::Mat& valid, const cv::Mat& blank,
                                    const RingCoordinate& rings, const std::vector<BorderGuess>& guesses) {
    std::vector<float> rooms;
    for (const BorderGuess& guess : guesses) rooms.push_back(static_cast<float>(guess.room));
    const cv::Mat slope = slope_across(wood, quantile(rooms, 0.5));
    std::vector<RowRange> photographed;
    for (int u = 0; u < valid.cols; ++u) photographed.push_back(photographed_rows(rings, blank, u));
    std::vector<float> rises;
    for (const BorderGuess& guess : guesses) rises.push_back(static_cast<float>(usual_rise(Band(guess).cut(slope))));
    const double least = std::max(least_rise * quantile(rises, 0.5), 1e-6);
    std::vector<BorderLine> borders;
    for (std::size_t i = 0; i < guesses.size(); ++i) {
        const std::vector<double> rows = lay(slope, photographed, guesses[i], std::max<double>(rises[i], least));
        BorderLine line = in_frame(rows, photographed, valid, rings);
        line.support = guesses[i].support;
        if (line.v.size() > 1) borders.push_back(std::move(line));
    }
    return borders;
}

}  // namespace crampfit
