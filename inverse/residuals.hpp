#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "datasets/record.hpp"
#include "inverse/curve.hpp"
#include "inverse/field_comparison.hpp"

#include <Eigen/Core>

#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// One experiment's data as stations at which a Record is compared with it.
///
/// Force: at displacements (at times where no displacement was measured). Explicit runs and tests vibrate, so both
/// curves get the same moving-window average, `smoothing_window` of the measured range wide, and the stations stand one
/// window apart: the windows tile the range, every row counts once, and the stations' errors are independent. Where rows are
/// fewer than four a window, those of a window that are no farther apart than half of it are averaged from the first to the last
/// of them, and rows farther apart are stations themselves: no line across a gap counts. Rows at one displacement are averaged,
/// and each counts; where the wood remembers, those of a hold count no more than those of a usual displacement. Latewood bands
/// that the crack crosses one by one leave peaks some tenth of the range apart, which a fiftieth keeps. Where the force falls
/// from one row to the next, as the crack jumps, when it did so is known to the rows' distance only, which counts as an error of
/// its own.
///
/// Arrival: the displacement (or time) at which the crack comes up to lengths spread over the measured growth, no closer
/// than it grows from row to row. What the crack length's noise sigma_a makes of the arrival is sigma_a / (da/du), the
/// slope taken over sigma_a to the flatter side. Where growth jumps, starts or ends between two rows it is no less than
/// the rows' distance, so that a jump has no infinite weight. Stations reached within one window, or in one jump, share
/// their rows and count as one together. A model that never reaches a station gets its last displacement and, for the
/// missing length, the displacement that the test took on average for as much growth: finite, continuous, and larger
/// the shorter the crack.
///
/// Break: where no crack length is measured and the force falls, from one row to the next and for good, to less than half of the
/// highest, the displacement (time) at which it did. In rows that are farther apart than the model's jump goes from run to run
/// the forces beside it are there or not, and lead nowhere.
///
/// Crack length: at displacements (times), as force is, over what windows of arrivals leave: tiles about a window wide between
/// them, or single rows, so that every row counts once, also where the crack stands or grows by less than noise, which says
/// little of when.
///
/// Force at lengths: where rows have neither a displacement nor a time, how far each is from the force over crack length that the
/// model goes through (ForcePath); `modelled` is off `measured` by as many standard deviations of the force. Of many rows those
/// that follow each other are averaged, so that no more than `most_rows` are left.
///
/// Force is compared where data exist. After the end of a Record the force is that of a slack machine if the specimen
/// split, else the last one.
class Comparison {
  public:
    static constexpr double smoothing_window = 0.02;  // of the measured range
    static constexpr int most_arrivals = 200;
    static constexpr int most_rows = 200;

    /// `model_resolution`: how well the model knows what it says, as a part of the displacement (time) to which it places an
    /// event, of the peak force that its vibration moves and of the longest crack. These count as errors beside the noise of the
    /// data.
    /// Throws InputError, naming the data file, for data with nothing in it to compare.
    explicit Comparison(const Experiment& experiment, double model_resolution = 0.0);

    /// The stations with what was measured at them; `modelled` and `residual` are left at 0.
    const std::vector<FitResidual>& stations() const { return stations_; }

    /// For how many measurements each station counts [stations]: one, or its part of those that share their rows.
    const std::vector<double>& counts() const { return counts_; }

    /// One sigma of each station where the model knows what it says to another resolution [stations], at little cost.
    Eigen::VectorXd sigmas(double model_resolution) const;

    /// From here on stations have these sigmas.
    void know_to(double model_resolution);

    /// What the record has at each station [stations], SI. All finite if the record's numbers are.
    /// `slack_force` is what the load cell says once the specimen has split [N].
    Eigen::VectorXd modelled(const Record& record, double slack_force = 0.0) const;

    /// What a person should know about how the data was used: the noise that it is taken to have, and its weight.
    const std::vector<std::string>& remarks() const { return remarks_; }

  private:
    void add_curves(const Experiment& experiment);
    std::vector<double> on_curves(const Record& record, double slack_force) const;
    void add_force_stations(const Experiment& experiment);
    void add_break(const Experiment& experiment, const Curve& rows, double noise, double least_fall);
    void add_crack_stations(const Experiment& experiment);
    void add_arrival_stations(const Experiment& experiment, const Curve& rows, double noise);
    void add_length_stations(const Experiment& experiment, const Curve& rows, double noise);
    void add_path_stations(const Experiment& experiment);
    std::vector<double> on_path(const Record& record, double slack_force) const;
    void tell_of_rows_without_place(const Experiment& experiment);
    void tell_of_creep(const Experiment& experiment);
    void tell_of_hold(const Experiment& experiment, const char* where);
    void tell_of_spikes(const Experiment& experiment, const Curve& rows);
    void count_hold(Curve& rows) const;
    double sigma(std::size_t station, double model_resolution) const;
    double noise_of(const Experiment& experiment, const char* what, const Curve& rows, const std::optional<double>& given);

    /// What the data know of a station [its unit].
    struct Errors {
        Eigen::Vector3d of_data;  // by noise, by sampling, by the place; of an arrival all in the first
        double half = 0;          // width of its average [m] or [s]
        double together = 1;      // stations that count as one
    };

    std::optional<double> longest_;  // crack, that ends runs [m]
    bool by_length_ = false;         // no time or displacement: rows are force at crack length
    bool by_time_ = false;           // stations stand on time [s] instead of displacement [m]
    bool may_relax_ = false;         // forces while displacement stands
    std::vector<double> abscissa_;   // measured displacement [m] or time [s], a row
    double abscissa_noise_ = 0;      // one sigma [m] or [s]
    double arrival_window_ = 0;      // of the average of crack length [m] or [s]
    double arrival_end_ = 0;         // of the measured crack lengths
    double pace_ = 0;                // mean displacement (time) a length of growth in the test [m/m] or [s/m]
    std::vector<std::pair<double, double>> force_tiles_;   // from, to [m] or [s]: one a station of force
    std::vector<std::pair<double, double>> length_tiles_;  // the same of crack length
    std::optional<Curve> forces_, lengths_;                // the rows [N], [m]
    double peak_force_ = 0, longest_length_ = 0;           // of them
    double force_noise_ = 0, length_noise_ = 0;            // of a row by length [N], [m]
    std::optional<FieldComparison> fields_;
    std::vector<FitResidual> stations_;  // of the curves, then of the fields
    std::vector<Errors> errors_;         // of the curves' stations
    std::vector<double> counts_;         // [stations]
    std::vector<std::string> noise_;     // of each column, in words
    std::vector<std::string> remarks_;
};

}  // namespace crampfit
