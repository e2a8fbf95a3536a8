#include "datasets/clock.hpp"

#include "datasets/error.hpp"

#include <Eigen/Dense>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace crampfit {
namespace {

constexpr int least_images = 3;  // on the load's record, to set a clock by
constexpr int offsets_tried = 2000;
constexpr int most_steps = 50;

bool measured(const std::vector<double>& column) {
    return std::ranges::any_of(column, [](double value) { return !std::isnan(value); });
}

/// One quantity that both the images and the load's record have.
class SharedChannel {
  public:
    SharedChannel(const Curves& images, const Curves& load, std::vector<double> Curves::*column)
        : times_(images.time), values_(images.*column), load_times_(load.time), load_(load.*column) {
        reach_ = 0.25 * (load_times_.back() - load_times_.front()) / static_cast<double>(load_times_.size());
    }

    struct Comparison {
        std::vector<double> time, off,
            slope;  // of the images on the load's record: on their clock [s]; image less load; of the load [1/s]

        double mean_square() const {
            double sum = 0;
            for (const double value : off) sum += value * value;
            return off.empty() ? INFINITY : sum / static_cast<double>(off.size());
        }
        double mean_slope() const {
            double sum = 0;
            for (const double value : slope) sum += value * value;
            return slope.empty() ? 0 : std::sqrt(sum / static_cast<double>(slope.size()));
        }
    };

    Comparison compare(double offset, double rate) const {
        Comparison result;
        for (std::size_t i = 0; i < times_.size(); ++i) {
            const double at = offset + rate * times_[i];
            const double off = values_[i] - load_at(load_times_, load_, at);
            if (std::isnan(off)) continue;
            const double from = std::max(load_times_.front(), at - reach_), to = std::min(load_times_.back(), at + reach_);
            result.time.push_back(times_[i]);
            result.off.push_back(off);
            result.slope.push_back((load_at(load_times_, load_, to) - load_at(load_times_, load_, from)) / (to - from));
        }
        return result;
    }

    /// The best of many offsets at which half of the images at least lie on the record.
    double scan(double rate) const {
        const double first = load_times_.front() - rate * times_.back(), last = load_times_.back() - rate * times_.front();
        double best = first, least = INFINITY;
        for (int i = 0; i <= offsets_tried; ++i) {
            const double offset = std::lerp(first, last, static_cast<double>(i) / offsets_tried);
            const Comparison here = compare(offset, rate);
            if (2 * here.off.size() < times_.size() || static_cast<int>(here.off.size()) < least_images ||
                !(here.mean_square() < least))
                continue;
            least = here.mean_square();
            best = offset;
        }
        return best;
    }

    /// Gauss and Newton's method for the offset, and the rate where it is free.
    void refine(double& offset, double& rate, bool rate_is_free) const {
        for (int step = 0; step < most_steps; ++step) {
            const Comparison here = compare(offset, rate);
            Eigen::Matrix2d normal = Eigen::Matrix2d::Zero();
            Eigen::Vector2d right = Eigen::Vector2d::Zero();
            for (std::size_t i = 0; i < here.off.size(); ++i) {
                const Eigen::Vector2d row = here.slope[i] * Eigen::Vector2d(1, rate_is_free ? here.time[i] : 0);
                normal += row * row.transpose();
                right += row * here.off[i];
            }
            if (!rate_is_free) normal(1, 1) = 1;
            Eigen::Vector2d change = normal.ldlt().solve(right);
            double share = 1;
            while (share > 1e-3 &&
                   !(compare(offset + share * change[0], rate + share * change[1]).mean_square() < here.mean_square()))
                share *= 0.5;
            if (share <= 1e-3 || !change.allFinite()) return;
            offset += share * change[0];
            rate += share * change[1];
        }
    }

  private:
    const std::vector<double>&times_, &values_, &load_times_, &load_;
    double reach_;  // over which a slope is taken, to either side [s]
};

}  // namespace

double load_at(const std::vector<double>& times, const std::vector<double>& values, double time) {
    // Times to the last digit lie on the record's ends whatever an offset and a rate have rounded.
    const double rounding =
        1e-15 * std::max(std::abs(times.front()), std::abs(times.back())) + 1e-9 * (times.back() - times.front());
    if (!(time >= times.front() - rounding && time <= times.back() + rounding)) return CrackTip::unknown;
    time = std::clamp(time, times.front(), times.back());
    const auto after = std::ranges::lower_bound(times, time);
    const auto i = static_cast<std::size_t>(after - times.begin());
    if (*after == time) return values[i];
    return std::lerp(values[i - 1], values[i], (time - times[i - 1]) / (times[i] - times[i - 1]));
}

ClockSetting set_clock(const Curves& images, const Curves& load, const ClockChoice& told, const std::filesystem::path& file) {
    ClockSetting clock;
    clock.rate = told.rate.value_or(1.0);
    const bool given = told.offset || told.trigger;
    if (given) {
        clock.offset = told.offset ? *told.offset : *told.trigger - clock.rate * images.time.front();
        clock.reason = told.offset ? "as told" : "by the trigger of the first image";
    } else {
        clock.reason = told.rate ? "the same start; rate as told" : "taken for the same";
    }
    for (const auto& [name, column] : {std::pair{"displacement", &Curves::displacement}, {"force", &Curves::force}}) {
        if (!measured(images.*column) || !measured(load.*column)) continue;
        const SharedChannel channel(images, load, column);
        if (!given) {
            clock.offset = channel.scan(clock.rate);
            channel.refine(clock.offset, clock.rate, !told.rate);
            clock.reason = fmt::format("by the {} that images and load share", name);
        }
        const SharedChannel::Comparison left = channel.compare(clock.offset, clock.rate);
        if (static_cast<int>(left.off.size()) < least_images || !(left.mean_slope() > 0))
            throw InputError(file.string(), name, fmt::format("{} images on the load's record", left.off.size()),
                             fmt::format("to set the clock by, {} images at least must lie on it, and the {} must change",
                                         least_images, name));
        clock.misalignment = std::sqrt(left.mean_square()) / left.mean_slope();
        break;
    }
    return clock;
}

}  // namespace crampfit
