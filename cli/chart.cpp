#include "cli/chart.hpp"

#include "cli/html.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit::cli {

namespace {

constexpr double plot_width = 400, plot_height = 250;                                                          // of the axes [px]
constexpr double least_left = 62, margin_right = 14, margin_bottom = 42, legend_line = 16, title_height = 20;  // [px]
constexpr double character_width = 6.2;      // of the legend, on average [px]
constexpr double digit_width = 6.8;          // of the ticks [px]
constexpr double beside_ticks = 29;          // the axis' label and the ticks' lines [px]
constexpr std::size_t most_vertices = 1200;  // of a line

/// One axis: numbers to pixels.
struct Axis {
    double low = INFINITY, high = -INFINITY;
    double from = 0, to = 1;  // [px]
    bool log = false;

    bool takes(double value) const { return std::abs(value) < 1e150 && (!log || value > 0); }  // differences stay finite
    void include(double value) {
        if (takes(value)) {
            low = std::min(low, value);
            high = std::max(high, value);
        }
    }
    double at(double value) const {
        const double part = log ? std::log(value / low) / std::log(high / low) : (value - low) / (high - low);
        return from + part * (to - from);
    }
    /// Room at both ends, and a range where all values are the same, or so nearly that ticks could not tell them apart.
    void widen() {
        if (!(low <= high)) low = high = log ? 1 : 0;
        if (log) {
            const double factor = std::max(1.2, std::pow(high / low, 0.04));
            low /= factor;
            high *= factor;
        } else {
            const double size = std::max(std::abs(low), std::abs(high));
            const double room = high - low > 1e-4 * size ? 0.04 * (high - low) : size > 0 ? 0.1 * size : 1;
            low -= room;
            high += room;
        }
    }
};

/// Steps of 1, 2 or 5 times a power of ten, about `count` of them.
std::vector<double> linear_ticks(const Axis& axis, int count) {
    const double rough = (axis.high - axis.low) / count;
    const double power = std::pow(10, std::floor(std::log10(rough)));
    double step = 10 * power;
    for (const double factor : {5.0, 2.0, 1.0})
        if (factor * power >= rough) step = factor * power;
    std::vector<double> ticks;
    for (double i = std::ceil(axis.low / step); i * step <= axis.high && ticks.size() < 50; ++i) ticks.push_back(i * step);
    return ticks;
}

/// Powers of ten, or with 2 and 5 between them where there are few.
std::vector<double> log_ticks(const Axis& axis) {
    const double decades = std::log10(axis.high / axis.low);
    const double stride = std::max(1.0, std::ceil(decades / 8));
    std::vector<double> ticks;
    for (double i = std::floor(std::log10(axis.low)); i <= std::log10(axis.high); i += stride)
        for (const double factor : {1.0, 2.0, 5.0})
            if (const double tick = factor * std::pow(10, i);
                (factor == 1 || decades < 2.5) && tick >= axis.low && tick <= axis.high)
                ticks.push_back(tick);
    return ticks;
}

std::string number_text(double value, double step) {
    const double clean = std::abs(value) < 1e-9 * step ? 0 : value;
    std::string text = fmt::format("{:.6g}", clean);
    if (text.front() == '-') text.replace(0, 1, "−");
    return text;
}

class Drawing {
  public:
    explicit Drawing(const Chart& chart) : chart_(chart) {
        y_.log = chart.log_y;
        for (const ChartSeries& series : chart.series) include(series);
        for (const ChartPicture& picture : chart.pictures) {
            for (const double x : {picture.left, picture.right}) x_.include(x);
            for (const double y : {picture.bottom, picture.top}) y_.include(y);
        }
        for (const double level : chart.y_levels) y_.include(level);
        empty_ = !(x_.low <= x_.high && y_.low <= y_.high);
        x_.widen();
        y_.widen();
        place();
    }

    std::string figure() {
        if (empty_) return {};
        draw_pictures();
        draw_axes();
        for (const ChartSeries& series : chart_.series) draw_series(series);
        const std::string caption =
            chart_.caption.empty() ? "" : fmt::format("<figcaption>{}</figcaption>\n", escaped(chart_.caption));
        return fmt::format(
            "<figure>\n<svg viewBox=\"0 0 {:.0f} {:.0f}\" role=\"img\" aria-label=\"{}\">\n{}{}</svg>\n{}{}</figure>\n", width_,
            height_, escaped(chart_.title + ": " + chart_.y_label + " against " + chart_.x_label), heading(), svg_, caption,
            chart_.legend_markup);
    }

  private:
    void include(const ChartSeries& series) {
        for (std::size_t i = 0; i < series.x.size(); ++i) {
            if (!x_.takes(series.x[i]) || !y_.takes(series.y[i])) continue;
            const double dx = series.x_error.empty() ? 0 : series.x_error[i];
            const double dy = series.y_error.empty() ? 0 : series.y_error[i];
            for (const double sign : {-1.0, 1.0}) {
                x_.include(series.x[i] + sign * dx);
                y_.include(series.y[i] + sign * dy);
            }
            if (series.kind == ChartSeries::Kind::bars) y_.include(0);
        }
    }

    std::vector<double> y_ticks() const { return y_.log ? log_ticks(y_) : linear_ticks(y_, 5); }
    std::string y_text(double tick) const { return number_text(tick, y_.log ? 1e-300 : y_.high - y_.low); }

    /// The rectangle of the axes, below the title and the legend.
    void place() {
        for (const double tick : y_ticks()) {
            const std::string text = y_text(tick);
            const auto letters = std::ranges::count_if(text, [](char c) { return (c & 0xc0) != 0x80; });  // of UTF-8
            left_ = std::max(left_, beside_ticks + digit_width * static_cast<double>(letters));
        }
        double wide = plot_width, high = plot_height;
        if (chart_.equal_scales) {
            const double ratio = (y_.high - y_.low) / (x_.high - x_.low);
            high = std::min(wide * ratio, 1.2 * plot_width);
            wide = high / ratio;
        }
        double line = 0;
        int lines = 0;
        for (const ChartSeries& series : chart_.series) {
            if (series.label.empty()) continue;
            const double needed = 30 + character_width * static_cast<double>(series.label.size());
            if (lines == 0 || line + needed > plot_width) {
                ++lines;
                line = 0;
            }
            legend_.push_back({left_ + line, title_height + legend_line * (lines - 0.3), &series});
            line += needed;
        }
        const double top = title_height + legend_line * lines + 8;
        x_.from = left_;
        x_.to = left_ + wide;
        ceiling_ = top;
        floor_ = top + high;
        y_.from = chart_.y_down ? ceiling_ : floor_;
        y_.to = chart_.y_down ? floor_ : ceiling_;
        width_ = left_ + plot_width + margin_right;
        height_ = top + high + margin_bottom;
    }

    std::string heading() const {
        std::string text =
            fmt::format("<text x=\"{}\" y=\"14\" font-weight=\"600\" font-size=\"12\">{}</text>\n", left_, escaped(chart_.title));
        for (const LegendEntry& entry : legend_) {
            const ChartSeries& series = *entry.series;
            text += series.kind == ChartSeries::Kind::points
                        ? fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"2.6\" fill=\"{}\" />", entry.x + 9, entry.y - 4,
                                      series.colour)
                        : fmt::format("<path d=\"M{:.1f} {:.1f}h18\" stroke=\"{}\" stroke-width=\"2\"{} />", entry.x, entry.y - 4,
                                      series.colour, dashes(series));
            text += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\">{}</text>\n", entry.x + 23, entry.y, escaped(series.label));
        }
        return text;
    }

    static const char* dashes(const ChartSeries& series) {
        return series.kind == ChartSeries::Kind::dashed ? " stroke-dasharray=\"5 3\"" : "";
    }

    /// Wraps what belongs to a frame.
    std::string framed(int frame, const std::string& markup) const {
        if (frame == always) return markup;
        return fmt::format("<g data-frame=\"{}\"{}>{}</g>\n", frame, frame == chart_.last_frame ? " class=\"shown last\"" : "",
                           markup);
    }

    void draw_pictures() {
        for (const ChartPicture& picture : chart_.pictures) {
            const double left = x_.at(picture.left), top = y_.at(picture.top);
            svg_ += framed(picture.frame,
                           fmt::format("<image href=\"{}\" x=\"{:.2f}\" y=\"{:.2f}\" width=\"{:.2f}\" height=\"{:.2f}\" "
                                       "preserveAspectRatio=\"none\" />\n",
                                       picture.address, left, top, x_.at(picture.right) - left, y_.at(picture.bottom) - top));
        }
    }

    void draw_axes() {
        const std::vector<double> x_ticks = linear_ticks(x_, 6);
        const bool grid = chart_.pictures.empty();
        for (const double tick : x_ticks) {
            if (grid) line(x_.at(tick), floor_, x_.at(tick), ceiling_, "#ececec");
            line(x_.at(tick), floor_, x_.at(tick), floor_ + 4, "#555");
            svg_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n", x_.at(tick), floor_ + 16,
                                number_text(tick, x_.high - x_.low));
        }
        for (const double tick : y_ticks()) {
            if (grid) line(x_.from, y_.at(tick), x_.to, y_.at(tick), "#ececec");
            line(x_.from - 4, y_.at(tick), x_.from, y_.at(tick), "#555");
            svg_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"end\">{}</text>\n", x_.from - 7, y_.at(tick) + 4,
                                y_text(tick));
        }
        for (const double level : chart_.x_levels)
            if (level >= x_.low && level <= x_.high)
                line(x_.at(level), floor_, x_.at(level), ceiling_, colour::gray, " stroke-dasharray=\"4 3\"");
        for (const double level : chart_.y_levels)
            line(x_.from, y_.at(level), x_.to, y_.at(level), colour::gray, " stroke-dasharray=\"4 3\"");
        svg_ += fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}H{:.1f}\" fill=\"none\" stroke=\"#555\" />\n", x_.from, ceiling_,
                            floor_, x_.to);
        svg_ += fmt::format("<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"middle\">{}</text>\n", 0.5 * (x_.from + x_.to),
                            floor_ + 34, escaped(chart_.x_label));
        svg_ += fmt::format("<text transform=\"translate(14 {:.1f}) rotate(-90)\" text-anchor=\"middle\">{}</text>\n",
                            0.5 * (y_.from + y_.to), escaped(chart_.y_label));
    }

    void line(double x1, double y1, double x2, double y2, const char* stroke, const char* more = "") {
        svg_ += fmt::format("<path d=\"M{:.1f} {:.1f}L{:.1f} {:.1f}\" stroke=\"{}\"{} />\n", x1, y1, x2, y2, stroke, more);
    }

    void draw_series(const ChartSeries& series) {
        switch (series.kind) {
        case ChartSeries::Kind::line:
        case ChartSeries::Kind::dashed:
            return draw_line(series);
        case ChartSeries::Kind::points:
            return draw_points(series);
        case ChartSeries::Kind::bars:
            return draw_bars(series);
        }
    }

    bool can_draw(const ChartSeries& series, std::size_t i) const { return x_.takes(series.x[i]) && y_.takes(series.y[i]); }

    /// Long lines are thinned to the first, lowest, highest and last of each stretch: peaks stay.
    static std::vector<std::size_t> vertices(const ChartSeries& series) {
        std::vector<std::size_t> all;
        const std::size_t stretch = std::max<std::size_t>(1, 4 * series.x.size() / most_vertices);
        for (std::size_t begin = 0; begin < series.x.size(); begin += stretch) {
            const std::size_t end = std::min(begin + stretch, series.x.size());
            const auto first = series.y.begin();
            const auto [low, high] =
                std::minmax_element(first + static_cast<std::ptrdiff_t>(begin), first + static_cast<std::ptrdiff_t>(end));
            std::vector<std::size_t> kept{begin, static_cast<std::size_t>(low - first), static_cast<std::size_t>(high - first),
                                          end - 1};
            std::ranges::sort(kept);
            kept.erase(std::ranges::unique(kept).begin(), kept.end());
            all.insert(all.end(), kept.begin(), kept.end());
        }
        return all;
    }

    void draw_line(const ChartSeries& series) {
        std::string path;
        bool pen_down = false;
        for (const std::size_t i : vertices(series)) {
            if (can_draw(series, i))
                path += fmt::format("{}{:.1f} {:.1f}", pen_down ? 'L' : 'M', x_.at(series.x[i]), y_.at(series.y[i]));
            pen_down = can_draw(series, i);
        }
        const auto stroke = [&](const char* ink, double wide) {
            return fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"{} />\n",
                               path, ink, wide, dashes(series));
        };
        // Over a picture a line needs a rim to be seen.
        svg_ += framed(series.frame, (chart_.pictures.empty() ? "" : stroke("#fff", 4)) + stroke(series.colour, 1.6));
    }

    void draw_points(const ChartSeries& series) {
        std::string markup;
        for (std::size_t i = 0; i < series.x.size(); ++i) {
            if (!can_draw(series, i)) continue;
            const double x = x_.at(series.x[i]), y = y_.at(series.y[i]);
            if (!series.x_error.empty())
                markup +=
                    fmt::format("<path d=\"M{:.1f} {:.1f}H{:.1f}\" stroke=\"{}\" stroke-width=\"0.7\" />",
                                x_.at(series.x[i] - series.x_error[i]), y, x_.at(series.x[i] + series.x_error[i]), series.colour);
            if (!series.y_error.empty())
                markup +=
                    fmt::format("<path d=\"M{:.1f} {:.1f}V{:.1f}\" stroke=\"{}\" stroke-width=\"0.7\" />", x,
                                y_.at(series.y[i] - series.y_error[i]), y_.at(series.y[i] + series.y_error[i]), series.colour);
            markup += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{}\" fill=\"{}\" />\n", x, y,
                                  series.frame != always  ? 4.5
                                  : series.x.size() > 300 ? 1.3
                                                          : 2.3,
                                  series.colour);
        }
        svg_ += framed(series.frame, markup);
    }

    /// About each x, which are evenly spaced, up from 0.
    void draw_bars(const ChartSeries& series) {
        if (series.x.size() < 2) return;
        const double half = 0.5 * (series.x[1] - series.x[0]);
        for (std::size_t i = 0; i < series.x.size(); ++i)
            if (can_draw(series, i) && series.y[i] != 0)
                svg_ += fmt::format(
                    "<path d=\"M{0:.1f} {2:.1f}V{3:.1f}H{1:.1f}V{2:.1f}z\" fill=\"{4}\" fill-opacity=\"0.6\" />\n",
                    x_.at(series.x[i] - half), x_.at(series.x[i] + half), y_.at(0), y_.at(series.y[i]), series.colour);
    }

    struct LegendEntry {
        double x, y;  // [px]
        const ChartSeries* series;
    };

    const Chart& chart_;
    Axis x_, y_;
    bool empty_ = false;
    double left_ = least_left, width_ = 0, height_ = 0, ceiling_ = 0, floor_ = 0;  // [px]
    std::vector<LegendEntry> legend_;
    std::string svg_;
};

}  // namespace

std::string draw(const Chart& chart) { return Drawing(chart).figure(); }

ScaledUnit unit_for(const std::vector<double>& values, const std::vector<ScaledUnit>& choices) {
    double largest = 0;
    for (const double value : values)
        if (std::isfinite(value)) largest = std::max(largest, std::abs(value));
    for (const ScaledUnit& choice : choices)
        if (largest >= choice.factor) return choice;
    return largest > 0 ? choices.back() : choices.front();
}

std::vector<double> scaled(std::vector<double> values, const ScaledUnit& unit) {
    for (double& value : values) value /= unit.factor;
    return values;
}

}  // namespace crampfit::cli
