#pragma once

#include "datasets/experiment.hpp"
#include "datasets/fit.hpp"
#include "datasets/record.hpp"

#include <string>
#include <vector>

namespace crampfit {

/// Measured displacement fields as stations at which a Record is compared with them, x and y of each point in each picture that
/// was followed.
///
/// Where the camera may have moved, the small translation and rotation that brings the record's field nearest to the picture's is
/// added to it, for each picture anew: what is left is free of them, at the cost of three numbers a picture (variable projection;
/// Golub and Pereyra 1973). Then a field tells how strains go from place to place, and stiffness needs a force beside it.
///
/// All pictures are compared with one reference, whose noise makes half of each displacement's variance: what the pictures before
/// tell of it at a point is taken off there, so that residuals are independent and each picture tells no more than it has seen.
///
/// A point whose subset the simulated crack reaches is left out: there the record says what was measured. So is one that lies off
/// the simulated material. Beyond, over the same distance once more, points come to count little by little, so that residuals are
/// continuous in the crack's length.
class FieldComparison {
  public:
    /// The experiment must have fields.
    explicit FieldComparison(const Experiment& experiment);

    /// The stations with what was measured at them: all of kind "u_x", a picture after the other, then all of kind "u_y".
    const std::vector<FitResidual>& stations() const { return stations_; }

    /// What the record has at each station, but for the reference's noise [stations] [m]. Throws std::invalid_argument where it
    /// has not read the probes.
    std::vector<double> modelled(const Record& record) const;

    const std::string& remark() const { return remark_; }

  private:
    struct Point {  // that was followed in a picture
        std::size_t place;
        Vec2 measured;
        double sigma;
        double unforeseen;  // the part of it that pictures before do not tell
    };
    /// What pictures so far tell of the reference's noise at a place, in each component, as an error of displacements.
    struct ReferenceError {
        double precision = 0;     // [1/m^2]
        Vec2 sum = Vec2::Zero();  // precision times mean

        Vec2 mean() const { return precision > 0 ? Vec2(sum / precision) : Vec2(Vec2::Zero()); }
        double variance(double sigma) const;
        void take_in(const Vec2& off, const Point& point);
    };
    std::vector<Vec2> modelled(const std::vector<Point>& points, const ProbeReading& reading,
                               std::vector<ReferenceError>& reference) const;
    void move_with_camera(const std::vector<Point>& points, const std::vector<double>& share, std::vector<Vec2>& values) const;

    std::vector<Vec2> places_;  // [m]
    std::vector<std::vector<Point>> pictures_;
    double reach_ = 0;  // from the middle of a subset to its corner [m]
    bool camera_moves_ = true;
    std::vector<FitResidual> stations_;
    std::string remark_;
};

}  // namespace crampfit
