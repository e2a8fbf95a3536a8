#include "imaging/ring_borders.hpp"

#include "imaging/quantile.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

namespace crampfit {
namespace {

constexpr double least_known = 0.3;        // share of a place's surroundings that must count
constexpr double least_prominence = 0.35;  // of a rise, against the contrast around it
constexpr double least_contrast = 0.3;     // of a place, against the picture's
constexpr double least_support = 0.5;      // share of profiles that must show a border
constexpr double nearness = 0.3;           // of neighbours, up to which a rise continues a border

/// One column of the straightened picture.
struct Profile {
    int column = 0;
    std::vector<float> gray;
    std::vector<char> known;
    RowRange photographed;
};

/// A rise of gray in a profile.
struct Rise {
    double row = 0;     // where it is steepest
    double height = 0;  // from the darkest before it to the brightest after it
    double room = 0;    // to the nearest other rise
};

Profile take_profile(const StraightPicture& straight, const RingCoordinate& rings, int column, double sigma,
                     const cv::Mat& blank) {
    Profile profile;
    profile.column = column;
    profile.photographed = photographed_rows(rings, blank, column);
    cv::Mat gray, known;
    const cv::Mat weight = straight.known.col(column).clone();
    cv::GaussianBlur(straight.gray.col(column).mul(weight), gray, {1, 0}, sigma, sigma, cv::BORDER_CONSTANT);
    cv::GaussianBlur(weight, known, {1, 0}, sigma, sigma, cv::BORDER_CONSTANT);
    for (int row = 0; row < gray.rows; ++row) {
        const float share = known.at<float>(row);
        profile.known.push_back(weight.at<float>(row) >= least_known);
        profile.gray.push_back(share > 0 ? gray.at<float>(row) / share : 0);
    }
    return profile;
}

/// Difference of bright and dark within `reach` of each row, taken at every tenth of it.
std::vector<double> contrast_around(const Profile& profile, int reach) {
    const int rows = static_cast<int>(profile.gray.size()), step = std::max(1, reach / 10);
    std::vector<double> contrast(rows, 0);
    for (int from = 0; from < rows; from += step) {
        std::vector<float> known;
        for (int row = std::max(0, from - reach); row < std::min(rows, from + reach + 1); ++row)
            if (profile.known[row]) known.push_back(profile.gray[row]);
        const double here = quantile(known, 0.95) - quantile(known, 0.05);
        std::fill(contrast.begin() + from, contrast.begin() + std::min(rows, from + step), here);
    }
    return contrast;
}

std::optional<Rise> steepest_between(const Profile& profile, int from, int to) {
    const auto slope = [&](int row) {
        const bool known = profile.known[row - 1] && profile.known[row] && profile.known[row + 1];
        return known ? profile.gray[row + 1] - profile.gray[row - 1] : 0.0f;
    };
    int best = 0;
    for (int row = std::max(from, 2); row <= std::min<int>(to, static_cast<int>(profile.gray.size()) - 3); ++row)
        if (slope(row) > (best ? slope(best) : 0.0f)) best = row;
    if (!best) return std::nullopt;
    return Rise{static_cast<double>(best), static_cast<double>(profile.gray[to]) - profile.gray[from], 0};
}

/// Follows the profile from turning point to turning point; a turn counts when gray goes back by `least(row)`.
template <class Least>
std::vector<Rise> find_rises(const Profile& profile, const Least& least) {
    std::vector<Rise> rises;
    int low = -1, high = -1;  // extremes since the last turn
    bool rising = false;
    const auto end_rise = [&](int from, int to) {
        if (const auto rise = steepest_between(profile, from, to)) rises.push_back(*rise);
    };
    for (int row = 0; row < static_cast<int>(profile.gray.size()); ++row) {
        if (!profile.known[row]) continue;
        const float gray = profile.gray[row];
        if (low < 0) low = high = row;
        if (rising) {
            if (gray > profile.gray[high]) high = row;
            if (gray < profile.gray[high] - least(row)) {
                end_rise(low, high);
                rising = false;
                low = row;
            }
        } else {
            if (gray < profile.gray[low]) low = row;
            if (gray > profile.gray[low] + least(row)) {
                rising = true;
                high = row;
            }
        }
    }
    if (rising) end_rise(low, high);
    for (std::size_t i = 0; i < rises.size(); ++i) {
        const auto rows = static_cast<double>(profile.gray.size());
        const double before = i > 0 ? rises[i].row - rises[i - 1].row : rows;
        const double after = i + 1 < rises.size() ? rises[i + 1].row - rises[i].row : rows;
        rises[i].room = std::min(before, after);
    }
    return rises;
}

/// A border on its way through the profiles.
struct Track {
    std::vector<int> profile;
    std::vector<double> row;
    double room = 0;  // of its last rise
    double support = 0;

    double last_row() const {
        const std::size_t count = std::min<std::size_t>(3, row.size());
        return std::accumulate(row.end() - static_cast<std::ptrdiff_t>(count), row.end(), 0.0) / static_cast<double>(count);
    }
    /// Straight between what was seen, level beyond.
    double row_at(double place) const {
        const auto after = std::lower_bound(profile.begin(), profile.end(), place);
        if (after == profile.begin()) return row.front();
        if (after == profile.end()) return row.back();
        const std::size_t i = static_cast<std::size_t>(after - profile.begin());
        const double share = (place - profile[i - 1]) / (profile[i] - profile[i - 1]);
        return row[i - 1] + share * (row[i] - row[i - 1]);
    }
};

/// Each rise continues the track that is nearest, where each is the other's nearest; or begins one.
void join(std::vector<Track>& tracks, const std::vector<Rise>& rises, int profile) {
    const auto distance = [](const Track& track, const Rise& rise) { return std::abs(track.last_row() - rise.row); };
    const std::size_t open = tracks.size();
    std::vector<std::size_t> nearest_rise(open);
    for (std::size_t t = 0; t < open; ++t)
        for (std::size_t r = 0; r < rises.size(); ++r)
            if (distance(tracks[t], rises[r]) < distance(tracks[t], rises[nearest_rise[t]])) nearest_rise[t] = r;
    for (std::size_t r = 0; r < rises.size(); ++r) {
        std::size_t best = open;
        for (std::size_t t = 0; t < open; ++t) {
            const double limit = std::max(2.5, nearness * std::min(tracks[t].room, rises[r].room));
            if (nearest_rise[t] == r && distance(tracks[t], rises[r]) <= limit &&
                (best == open || tracks[t].profile.size() > tracks[best].profile.size()))
                best = t;
        }
        Track& track = best < open ? tracks[best] : tracks.emplace_back();
        track.profile.push_back(profile);
        track.row.push_back(rises[r].row);
        track.room = rises[r].room;
    }
}

/// Share of the profiles that show the track, among those that its level meets within the picture: what shows in less
/// than half of them is a chip or chance.
double support_of(const Track& track, const std::vector<Profile>& profiles) {
    int within = 0;
    for (std::size_t k = 0; k < profiles.size(); ++k)
        within += profiles[k].photographed.holds(track.row_at(static_cast<double>(k)));
    return static_cast<double>(track.profile.size()) / std::max(within, 1);
}

double mean_distance(const Track& a, const Track& b) {
    const int first = std::min(a.profile.front(), b.profile.front()), last = std::max(a.profile.back(), b.profile.back());
    double sum = 0;
    for (int k = first; k <= last; ++k) sum += std::abs(a.row_at(k) - b.row_at(k));
    return sum / (last - first + 1);
}

/// Tracks that hold, from the pith outward; of two that run together only the better one.
std::vector<Track> keep(std::vector<Track> tracks, const std::vector<Profile>& profiles) {
    std::vector<Track> kept;
    const std::size_t least = std::min<std::size_t>(3, profiles.size());
    for (Track& track : tracks) {
        track.support = support_of(track, profiles);
        if (track.profile.size() >= least && track.support >= least_support) kept.push_back(track);
    }
    std::sort(kept.begin(), kept.end(), [](const Track& a, const Track& b) { return a.profile.size() > b.profile.size(); });
    std::vector<Track> chosen;
    for (const Track& track : kept) {
        const bool doubled = std::any_of(chosen.begin(), chosen.end(), [&](const Track& other) {
            return mean_distance(track, other) < nearness * std::min(track.room, other.room);
        });
        if (!doubled) chosen.push_back(track);
    }
    std::sort(chosen.begin(), chosen.end(), [](const Track& a, const Track& b) {
        const double middle =
            0.5 * (std::max(a.profile.front(), b.profile.front()) + std::min(a.profile.back(), b.profile.back()));
        return a.row_at(middle) < b.row_at(middle);
    });
    return chosen;
}

/// Profiles across the rings, each a blurred stretch of them apart.
std::vector<Profile> take_profiles(const StraightWood& wood, const cv::Mat& blank, const RingCoordinate& rings,
                                   double ring_width) {
    const double most = ring_width > 0 ? std::max(2.0, 0.4 * ring_width) : 20;
    const double along = std::clamp(blank.cols / 60.0, 1.0, most);
    const double across = ring_width > 0 ? std::clamp(0.04 * ring_width, 1.0, 4.0) : 1.5;
    const StraightPicture straight = wood.blurred_along(along);
    const int count = std::max(1, static_cast<int>(blank.cols / (2 * along)));
    std::vector<Profile> profiles;
    for (int k = 0; k < count; ++k)
        profiles.push_back(take_profile(straight, rings, static_cast<int>((k + 0.5) * blank.cols / count), across, blank));
    return profiles;
}

/// Every track there is through the profiles.
std::vector<Track> follow(const std::vector<Profile>& profiles, double ring_width) {
    std::vector<std::vector<double>> contrasts;
    std::vector<float> all;
    for (const Profile& profile : profiles) {
        const int rows = static_cast<int>(profile.gray.size());
        const int reach = ring_width > 0 ? std::max(5, static_cast<int>(2.5 * ring_width)) : rows;
        contrasts.push_back(contrast_around(profile, reach));
        for (int row = 0; row < rows; row += std::max(1, rows / 100))
            if (profile.known[row]) all.push_back(static_cast<float>(contrasts.back()[row]));
    }
    const double floor = least_contrast * quantile(all, 0.5);
    std::vector<Track> tracks;
    for (std::size_t k = 0; k < profiles.size(); ++k) {
        const auto least = [&](int row) { return least_prominence * std::max(contrasts[k][row], floor) + 1e-6; };
        join(tracks, find_rises(profiles[k], least), static_cast<int>(k));
    }
    return tracks;
}

/// Where each track is to be laid.
std::vector<BorderGuess> guesses(const std::vector<Track>& tracks, int columns, std::size_t profiles) {
    std::vector<BorderGuess> all;
    for (const Track& track : tracks) {
        BorderGuess& guess = all.emplace_back(std::vector<double>(columns), track.room, track.support);
        for (int u = 0; u < columns; ++u) guess.row[u] = track.row_at((u + 0.5) * static_cast<double>(profiles) / columns - 0.5);
    }
    return all;
}

}  // namespace

std::vector<BorderLine> find_ring_borders(const StraightWood& wood, const cv::Mat& valid, const cv::Mat& blank,
                                          const RingCoordinate& rings, double ring_width) {
    const std::vector<Profile> profiles = take_profiles(wood, blank, rings, ring_width);
    const std::vector<Track> tracks = keep(follow(profiles, ring_width), profiles);
    return lay_borders(wood, valid, blank, rings, guesses(tracks, valid.cols, profiles.size()));
}

double typical_ring_width(const std::vector<BorderLine>& borders) {
    std::vector<float> widths;
    for (std::size_t i = 1; i < borders.size(); ++i) {
        const BorderLine &inner = borders[i - 1], &outer = borders[i];
        const int middle = (std::max(inner.first, outer.first) + std::min(inner.end(), outer.end())) / 2;
        if (inner.covers(middle) && outer.covers(middle))
            widths.push_back(static_cast<float>(outer.at(middle) - inner.at(middle)));
    }
    return quantile(widths, 0.5);
}

}  // namespace crampfit
