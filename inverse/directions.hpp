#pragma once

#include "inverse/local_model.hpp"
#include "inverse/objective.hpp"

#include <Eigen/Core>

#include <optional>

namespace crampfit {

/// How the residuals change about the best run: the slope J of a polynomial through the runs near it, its columns
/// scaled to length one, taken apart into singular values. A parameter whose column cannot be told from none has a column of
/// zeros and a direction of its own. Beside a jump few residuals scatter by much: where all together do not tell every direction,
/// each counts for no more than its scatter leaves of it, if that tells more.
struct Directions {
    Run best;
    LocalModel model;
    double radius = 0;         // of the differences that the model rests on, a part of the box
    Eigen::VectorXd weight;    // [residuals]: 1; less where a residual scatters and hides what the others tell
    Eigen::MatrixXd slope;     // J, rows by their weight [residuals x parameters]
    Eigen::VectorXd scale;     // of x: 1 / length of J's columns [parameters]
    Eigen::VectorXd singular;  // falling [parameters]
    Eigen::VectorXd error;     // one sigma of each singular value, by the model's scatter [parameters]
    double least = 2;          // times its error that a singular value must be, to be told from zero
    Eigen::MatrixXd u;         // [residuals x parameters]
    Eigen::MatrixXd v;         // in scaled x [parameters x parameters]

    /// Whether J tells direction k from zero.
    bool resolved(Eigen::Index k) const;

    /// Whether wider differences may tell more than these: of a direction that scatter hides, not of one without any effect.
    bool wider_would_tell() const;
};

/// Runs the differences about the best run that have not been run yet, and takes wider ones where the model's scatter
/// hides a slope. A difference that turns out better than the best run takes its place. Absent where too few runs near
/// it ended well. There must be a usable run.
std::optional<Directions> directions_about_best(Objective& objective, double step);

}  // namespace crampfit
