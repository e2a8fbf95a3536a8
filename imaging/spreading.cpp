#include "imaging/spreading.hpp"

#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <atomic>
#include <barrier>
#include <cmath>
#include <queue>
#include <thread>

namespace crampfit {
namespace {

constexpr std::size_t round_size = 256;    // points followed at once: some milliseconds of work
constexpr int seed_every = 4;              // points of the lattice between those that may be sought in the whole image
constexpr std::size_t most_searches = 64;  // in the whole image
constexpr double seed_zncc = 0.5;          // at whole pixels; the match that is begun there must reach more

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
        for (int i = 0; i < threads; ++i) matchers_.emplace_back(reference_, spline_, subset);
    }

    std::vector<SubsetMatch> run() {
        const std::vector<int> all = seeds();
        // The whole image is searched for some of the seeds at most; once one is found, others are sought near by.
        const std::size_t every = (all.size() + most_searches - 1) / most_searches;
        for (std::size_t i = 0; i < all.size() && nothing_found(); i += every) begin_from(all[i]);
        for (std::size_t i = 0; i < all.size() && !nothing_found(); ++i) begin_from(all[i]);
        return std::move(matches_);
    }

  private:
    static std::size_t index(int point) { return static_cast<std::size_t>(point); }

    bool nothing_found() const { return low_u_ > high_u_; }

    void begin_from(int seed) {
        if (matches_[index(seed)].status != PointStatus::not_reached) return;
        if (const auto guess = search(seed)) {
            jobs_ = {{seed, *guess, {}}};
            spread();
        }
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

    /// The place of the best correlation at whole pixels: in the whole image for the first seed, and for later ones in
    /// the range of what was found and half as far again.
    std::optional<Warp> search(int point) const {
        const cv::Mat reference = as_matrix(reference_.picture), image = as_matrix(image_);
        const int x = lattice_.x(point), y = lattice_.y(point), subset = 2 * half_ + 1;
        const cv::Rect window = search_window(x, y);
        cv::Mat zncc;
        cv::matchTemplate(image(window), reference(cv::Rect(x - half_, y - half_, subset, subset)), zncc, cv::TM_CCOEFF_NORMED);
        double best = 0;
        cv::Point place;
        cv::minMaxLoc(zncc, nullptr, &best, nullptr, &place);
        if (!(best >= seed_zncc)) return std::nullopt;
        Warp guess;
        guess.u[0] = window.x + place.x + half_ - x;
        guess.v[0] = window.y + place.y + half_ - y;
        return guess;
    }

    cv::Rect search_window(int x, int y) const {
        const cv::Rect whole(0, 0, image_.columns, image_.rows);
        if (nothing_found()) return whole;
        const int margin = 2 * half_ + static_cast<int>(std::max(high_u_ - low_u_, high_v_ - low_v_) / 2);
        const cv::Point from(x + static_cast<int>(low_u_) - margin, y + static_cast<int>(low_v_) - margin);
        const cv::Point to(x + static_cast<int>(high_u_) + margin + 1, y + static_cast<int>(high_v_) + margin + 1);
        const cv::Rect window = cv::Rect(from, to) & whole;
        const int subset = 2 * half_ + 1;
        return window.width < subset || window.height < subset ? whole : window;
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
            const int column = parent % lattice_.columns, row = parent / lattice_.columns;
            for (const auto& [dx, dy] : {std::pair{1, 0}, {-1, 0}, {0, 1}, {0, -1}}) {
                if (column + dx < 0 || column + dx >= lattice_.columns || row + dy < 0 || row + dy >= lattice_.rows) continue;
                const int point = parent + dx + dy * lattice_.columns;
                if (may_be_tried(point) && !chosen_[index(point)]) {
                    chosen_[index(point)] = true;
                    jobs_.push_back({point, continued(matches_[index(parent)].warp, dx, dy), {}});
                }
            }
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
