#pragma once

#include "datasets/fit.hpp"
#include "inverse/study_model.hpp"
#include "inverse/uncertainty.hpp"

#include <string>

namespace crampfit {

/// Cells twice as wide, each scene on that grid alone, change the residuals by g (`wide`, usable, with the best point's values),
/// and a fit there would have its best point off this one by m = -(J^T J)^-1 J^T g. J and g are weighed as that fit would weigh
/// them (StudyModel::likely_resolution): else single stations beside a jump had the say. Of an error that the finer of two grids
/// changes by m, 3 m / (2^2 - 1) may be left: the grid convergence index for two grids and a method of second order (Roache 1994,
/// Perspective: a method for uniform reporting of grid refinement studies, J. Fluids Eng. 116), which takes in errors that go
/// with the first power of the cell. Found: how far the truth may lie from the best point to either side [parameters, of the unit
/// cube]. A scene that takes a third of the difference of both grids off has moved away from the wide one by four thirds of that
/// difference: there three quarters of g count. Where what g says by stretches of the curves, each by itself, takes from each
/// other, its root of the sum of squares counts. On one grid errors of stiffness go with the first power of the cell, as where
/// bands are two or three cells wide: of a modulus 3 m / (2 - 1) may be left, up to what can be told.
///
/// `about` tells of the best point.
Eigen::VectorXd left_by_grid(const Study& study, StudyModel model, const Run& best, Evaluation wide, const Uncertainty& about);

/// Takes what the grid leaves into the fit: each interval goes on by it to either side, and covariance and standard errors count
/// it as spread evenly up to there, squares about the best point. Of a toughness two grids that happen to agree leave 1 % all the
/// same: loads into another wood are off by up to 0.7 % then (docs/accuracy.md), and toughness goes with their square. Where it
/// goes beyond a tenth of a parameter's value or, on a linear scale, of half its box if that is more, it cannot be told: that
/// tenth counts, and of the others ever more of theirs, up to twice as far off, where all do, each parameter's by itself. Of a
/// parameter that the data do not tell, whose interval is its whole box, nothing is asked. The message says it.
void take_in_grid(Fit& fit, const UnitBox& box, const Eigen::VectorXd& x, Eigen::VectorXd left);

/// Where nothing tells what the grid leaves, and why: as from twice as far off.
void take_in_untold_grid(Fit& fit, const UnitBox& box, const Eigen::VectorXd& x, const std::string& why);

}  // namespace crampfit
