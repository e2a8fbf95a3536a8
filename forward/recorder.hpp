#pragma once

#include "datasets/record.hpp"
#include "forward/explicit.hpp"

#include <array>

namespace crampfit {

/// The points with this displacement; when that is and the crack are the caller's.
/// `history`: of the points that have one, as it was settled with this displacement.
Frame make_frame(const Scene& scene, const Plan& plan, const Discretisation& body, const std::vector<Vec2>& displacement,
                 const History* history = nullptr);

/// The tip whose length, place, G and K the series holds: of the first crack that grows, or of the first.
struct TrackedTip {
    int crack = -1;  // -1: no crack
    bool at_end = true;
};
TrackedTip tracked_tip(const Scene& scene);

/// Watches a run and keeps what the scene asks for: rows of the series at even intervals, frames at even progress.
class Recorder {
  public:
    Recorder(const Scene& scene, const Plan& plan, const Discretisation& body, const ExplicitSolver& solver);

    /// After every step: takes part in the mean force of the next row.
    void add_step();

    /// Before every step: saves a row and a frame when they are due.
    void look();

    /// Saves the last instant.
    void finish(RunStatus status, std::string message);

    /// Time, displacement and crack length now; the rest as of the last row.
    Instant now() const;

    /// How far the nearest stop condition is, 0..1.
    double fraction() const;

    bool is_finite() const { return finite_; }
    Record take() { return std::move(record_); }

  private:
    struct HalfInterval {
        long count = 0;               // steps
        std::vector<Vec2> reactions;  // their sums
    };

    void save_row();
    void save_forces();
    double force_of(std::size_t row) const;
    void save_frame();
    void read_due_probes();
    void read_probes_now();
    void thin_out();

    const Scene& scene_;
    const Plan& plan_;
    const Discretisation& body_;
    const ExplicitSolver& solver_;
    Gauges gauges_;
    int crack_ = -1;  // the one in the series; -1: none
    bool at_end_ = true;

    Record record_;
    long interval_ = 1;   // steps between rows
    bool evenly_ = true;  // the interval is known from the end time
    long steps_ = 0;
    long next_row_ = 0;
    int frames_saved_ = 0;
    std::array<HalfInterval, 2> halves_;  // of the interval between two rows
    long before_last_row_ = 0;            // steps in the force of the last row
    std::vector<Vec2> since_last_row_;    // means over all of the last interval [N]
    double largest_energy_ = 0.0;         // [J]
    double largest_imbalance_ = 0.0;      // [J]
    bool finite_ = true;
};

}  // namespace crampfit
