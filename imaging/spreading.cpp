#include "imaging/spreading.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <cmath>
#include <numbers>
#include <optional>
#include <queue>
#include <thread>

namespace crampfit {
namespace {

constexpr std::size_t round_size = 256;  // points followed at once: some milliseconds of work
constexpr int seed_every = 4;            // points of the lattice between those that may be sought
constexpr double seed_zncc = 0.5;        // at whole pixels; the match that is begun there must reach more

// Searches of the whole image, each of which takes as long as some thousand matches.
constexpr std::size_t most_first = 24;    // for the first point
constexpr int turns = 12;                 // of the subset where it is not seen as it lies, around the circle
constexpr double most_off = 1;            // of a pixel at a subset's side from where a small turn has it [px]
constexpr int most_between = 8;           // steps from one of the turns to the next: larger subsets have larger spots, too
constexpr std::size_t most_turned = 4;    // of the points, each at all turns
constexpr std::size_t most_of_parts = 4;  // for each part of the specimen that nothing has spread to
constexpr std::size_t most_parts = 8;     // the largest

struct Job {
    int point;
    Warp guess;
    SubsetMatch match;
};

template <int Order>
class Spreading {
  public:
    Spreading(const ReferencePicture& reference, const FinePicture& image, const PointLattice& lattice,
              const std::vector<PointStatus>& at_start, int subset, int threads)
        : reference_(reference), image_(image), spline_(image), lattice_(lattice), half_(subset / 2), threads_(threads) {
        for (const PointStatus status : at_start) matches_.emplace_back().status = status;
        chosen_.assign(at_start.size(), false);
        given_up_.assign(at_start.size(), false);
        for (int i = 0; i < threads; ++i) matchers_.emplace_back(reference_, spline_, subset);
    }

    std::vector<SubsetMatch> run() {
        begin_anywhere(seeds());
        if (nothing_found()) return std::move(matches_);
        begin_nearby();
        // What is left may have moved away from the rest, as halves do that a crack has parted.
        std::size_t sought = 0;
        for (std::vector<int> part = largest_part_left(); !part.empty() && sought < most_parts;
             part = largest_part_left(), ++sought)
            if (begin_in(part)) begin_nearby();
        return std::move(matches_);
    }

  private:
    static std::size_t index(int point) { return static_cast<std::size_t>(point); }

    bool nothing_found() const { return low_u_ > high_u_; }
    cv::Rect whole_image() const { return {0, 0, image_.columns, image_.rows}; }

    /// The first point: in the whole image, as the subset lies, then turned a little either way by small steps, as fine spots ask
    /// for, and then all around by large ones.
    void begin_anywhere(const std::vector<int>& all) {
        const std::size_t every = (all.size() + most_first - 1) / most_first;
        for (std::size_t i = 0; i < all.size() && nothing_found(); i += every) begin_from(all[i], whole_image());
        constexpr double apart = 2 * std::numbers::pi / turns;
        const int steps = std::min(most_between, static_cast<int>(std::ceil(apart * half_ / (2 * most_off))));
        std::vector<double> angles;
        for (int step = 1; step < steps; ++step) angles.insert(angles.end(), {apart * step / steps, -apart * step / steps});
        begin_turned(all, angles);
        angles.clear();
        for (int turn = 1; turn < turns; ++turn) angles.push_back(apart * turn);
        begin_turned(all, angles);
    }

    void begin_turned(const std::vector<int>& all, const std::vector<double>& angles) {
        const std::size_t every = (all.size() + most_turned - 1) / most_turned;
        for (std::size_t i = 0; i < all.size() && nothing_found(); i += every)
            for (std::size_t turn = 0; turn < angles.size() && nothing_found(); ++turn) {
                turn_ = angles[turn];
                // A match that was begun from a wrong turn and failed says nothing of the next.
                if (may_be_tried(all[i])) matches_[index(all[i])].status = PointStatus::not_reached;
                begin_from(all[i], whole_image());
            }
    }

    /// Others: as far away as what was found, and half as far again.
    void begin_nearby() {
        mark_left();
        for (const int seed : seeds()) begin_from(seed, nearby(lattice_.x(seed), lattice_.y(seed)));
    }

    /// Points of a part, evenly through it: in the whole image, until one is found there.
    bool begin_in(const std::vector<int>& part) {
        for (std::size_t i = 0; i < most_of_parts; ++i) {
            const int point = part[(2 * i + 1) * part.size() / (2 * most_of_parts)];
            begin_from(point, whole_image());
            if (matches_[index(point)].status == PointStatus::ok) return true;
        }
        for (const int point : part) given_up_[index(point)] = true;
        return false;
    }

    void begin_from(int seed, const cv::Rect& window) {
        if (matches_[index(seed)].status != PointStatus::not_reached) return;
        if (const auto guess = search(seed, window)) {
            jobs_ = {{seed, *guess, {}}};
            spread();
        }
    }

    /// The largest connected set of points that nothing has spread to, nor was sought for in vain; empty where all have fewer
    /// points than a few seeds have about them.
    std::vector<int> largest_part_left() const {
        std::vector<int> largest;
        std::vector<bool> seen = given_up_;
        for (int start = 0; start < lattice_.count(); ++start) {
            std::vector<int> part;
            const auto take = [&](int point) {
                if (!seen[index(point)] && matches_[index(point)].status == PointStatus::not_reached) part.push_back(point);
                seen[index(point)] = true;
            };
            take(start);
            for (std::size_t next = 0; next < part.size(); ++next)
                for_neighbours(part[next], [&](int point, int, int) { take(point); });
            if (part.size() > largest.size()) largest = std::move(part);
        }
        if (largest.size() < most_of_parts * seed_every * seed_every) return {};
        std::ranges::sort(largest);
        return largest;
    }

    /// Points that lie outside the image, moved as what has been followed beside them, have left it.
    void mark_left() {
        std::vector<int> from;
        std::vector<bool> seen(matches_.size());
        for (int point = 0; point < lattice_.count(); ++point)
            if (matches_[index(point)].status == PointStatus::ok) from.push_back(point);
        for (std::size_t next = 0; next < from.size(); ++next) {
            const Warp warp = matches_[index(from[next])].warp;
            for_neighbours(from[next], [&](int point, int dx, int dy) {
                SubsetMatch& match = matches_[index(point)];
                if (match.status != PointStatus::not_reached && match.status != PointStatus::left_picture) return;
                const Warp on = continued(warp, dx, dy);
                const double x = lattice_.x(point) + on.u[0], y = lattice_.y(point) + on.v[0];
                if (seen[index(point)] || (x >= half_ && x < image_.columns - half_ && y >= half_ && y < image_.rows - half_))
                    return;
                seen[index(point)] = true;
                match.warp = on;
                match.status = PointStatus::left_picture;
                from.push_back(point);
            });
        }
    }

    template <class Visit>
    void for_neighbours(int point, Visit&& visit) const {
        const int column = point % lattice_.columns, row = point / lattice_.columns;
        for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}})
            if (column + dx >= 0 && column + dx < lattice_.columns && row + dy >= 0 && row + dy < lattice_.rows)
                visit(point + dx + dy * lattice_.columns, dx, dy);
    }

    /// Points that may be sought, those nearest to the picture's middle first.
    std::vector<int> seeds() const {
        std::vector<int> points;
        for (int row = seed_every / 2; row < std::max(lattice_.rows, seed_every / 2 + 1); row += seed_every)
            for (int column = seed_every / 2; column < std::max(lattice_.columns, seed_every / 2 + 1); column += seed_every)
                points.push_back(std::min(row, lattice_.rows - 1) * lattice_.columns + std::min(column, lattice_.columns - 1));
        const auto from_middle = [&](int point) {
            const int x = 2 * (point % lattice_.columns) - lattice_.columns, y = 2 * (point / lattice_.columns) - lattice_.rows;
            return x * x + y * y;
        };
        std::ranges::stable_sort(points, {}, from_middle);
        return points;
    }

    /// The place of the best correlation at whole pixels in a window of the image; none where that holds no subset.
    std::optional<Warp> search(int point, const cv::Rect& window) const {
        const int x = lattice_.x(point), y = lattice_.y(point), subset = 2 * half_ + 1;
        if (window.width < subset || window.height < subset) return std::nullopt;
        cv::Mat zncc;
        cv::matchTemplate(as_matrix(image_)(window), turned_subset(x, y), zncc, cv::TM_CCOEFF_NORMED);
        double best = 0;
        cv::Point place;
        cv::minMaxLoc(zncc, nullptr, &best, nullptr, &place);
        if (!(best >= seed_zncc)) return std::nullopt;
        const double c = std::cos(turn_), s = std::sin(turn_);
        Warp guess;
        guess.u = {static_cast<double>(window.x + place.x + half_ - x), (c - 1) * half_, -s * half_};
        guess.v = {static_cast<double>(window.y + place.y + half_ - y), s * half_, (c - 1) * half_};
        return guess;
    }

    /// The subset about a pixel of the reference, turned by `turn_` about its middle.
    cv::Mat turned_subset(int x, int y) const {
        const int subset = 2 * half_ + 1;
        if (turn_ == 0) return as_matrix(reference_.picture)(cv::Rect(x - half_, y - half_, subset, subset));
        const double c = std::cos(turn_), s = std::sin(turn_);
        const cv::Matx23d from(c, s, x - (c + s) * half_, -s, c, y - (c - s) * half_);
        cv::Mat turned;
        cv::warpAffine(as_matrix(reference_.picture), turned, from, {subset, subset}, cv::INTER_LINEAR | cv::WARP_INVERSE_MAP,
                       cv::BORDER_REFLECT_101);
        return turned;
    }

    cv::Rect nearby(int x, int y) const {
        const int margin = 2 * half_ + static_cast<int>(std::max(high_u_ - low_u_, high_v_ - low_v_) / 2);
        const cv::Point from(x + static_cast<int>(low_u_) - margin, y + static_cast<int>(low_v_) - margin);
        const cv::Point to(x + static_cast<int>(high_u_) + margin + 1, y + static_cast<int>(high_v_) + margin + 1);
        return cv::Rect(from, to) & whole_image();
    }

    static cv::Mat as_matrix(const FinePicture& picture) {
        return {picture.rows, picture.columns, CV_32F, const_cast<float*>(picture.gray.data())};
    }

    /// Follows `jobs_` and what spreads from them, until nothing more can be reached.
    void spread() {
        std::atomic<std::size_t> next{0};
        const auto work = [&](std::size_t thread) {
            for (std::size_t i = next++; i < jobs_.size(); i = next++)
                jobs_[i].match = matchers_[thread].match(lattice_.x(jobs_[i].point), lattice_.y(jobs_[i].point), jobs_[i].guess);
        };
        std::barrier round(threads_, [&]() noexcept {
            keep_results();
            choose_jobs();
            next = 0;
        });
        const auto rounds = [&](std::size_t thread) {
            while (!jobs_.empty()) {
                work(thread);
                round.arrive_and_wait();
            }
        };
        std::vector<std::jthread> others;
        for (int i = 1; i < threads_; ++i) others.emplace_back(rounds, static_cast<std::size_t>(i));
        rounds(0);
    }

    void keep_results() {
        for (const Job& job : jobs_) {
            chosen_[index(job.point)] = false;
            SubsetMatch& kept = matches_[index(job.point)];
            kept = job.match;
            if (kept.status != PointStatus::ok) continue;
            front_.push({kept.zncc, -job.point});
            const double u = kept.warp.u[0], v = kept.warp.v[0];
            const bool first = nothing_found();
            low_u_ = first ? u : std::min(low_u_, u);
            high_u_ = first ? u : std::max(high_u_, u);
            low_v_ = first ? v : std::min(low_v_, v);
            high_v_ = first ? v : std::max(high_v_, v);
        }
    }

    /// Neighbours of the most reliable points that have not been followed. A point that was lost is tried anew from its
    /// other neighbours, as long as there are any.
    void choose_jobs() {
        jobs_.clear();
        while (!front_.empty() && jobs_.size() < round_size) {
            const int parent = -front_.top().second;
            front_.pop();
            for_neighbours(parent, [&](int point, int dx, int dy) {
                if (!may_be_tried(point) || chosen_[index(point)]) return;
                chosen_[index(point)] = true;
                jobs_.push_back({point, continued(matches_[index(parent)].warp, dx, dy), {}});
            });
        }
    }

    bool may_be_tried(int point) const {
        switch (matches_[index(point)].status) {
        case PointStatus::not_reached:
        case PointStatus::no_convergence:
        case PointStatus::left_picture:
        case PointStatus::low_correlation:
            return true;
        default:
            return false;
        }
    }

    /// A warp as a neighbour's first guess: it goes on linearly.
    Warp continued(Warp warp, int dx, int dy) const {
        const double along = static_cast<double>(lattice_.step) / half_;
        warp.u[0] += along * (dx * warp.u[1] + dy * warp.u[2]);
        warp.v[0] += along * (dx * warp.v[1] + dy * warp.v[2]);
        return warp;
    }

    const ReferencePicture& reference_;
    const FinePicture& image_;
    SplinePicture spline_;
    PointLattice lattice_;
    int half_;
    int threads_;
    std::vector<SubsetMatcher<Order>> matchers_;  // one a thread
    std::vector<SubsetMatch> matches_;
    std::vector<Job> jobs_;                                   // of the round
    std::vector<bool> chosen_;                                // for the round
    std::vector<bool> given_up_;                              // points of parts that were sought in the whole image in vain
    double turn_ = 0;                                         // of subsets that are sought, clockwise as seen [rad]
    std::priority_queue<std::pair<double, int>> front_;       // ZNCC and number, negative, of points whose neighbours may be open
    double low_u_ = 1, high_u_ = 0, low_v_ = 1, high_v_ = 0;  // range of what was found [px]; empty at first
};

}  // namespace

std::vector<SubsetMatch> spread_matches(const ReferencePicture& reference, const FinePicture& image, const PointLattice& lattice,
                                        const std::vector<PointStatus>& at_start, int subset, int order, int threads) {
    if (order == 1) return Spreading<1>(reference, image, lattice, at_start, subset, threads).run();
    return Spreading<2>(reference, image, lattice, at_start, subset, threads).run();
}

}  // namespace crampfit
