#pragma once

#include "inverse/fit.hpp"

namespace crampfit {

/// Fits every model that the study compares, one after the other, and gives the fit of the best with the table of all. With c the
/// least reduced chi-square of any model, or 1, what the noise leaves unexplained:
///     AIC = misfit / c + d + 2 k,    BIC = misfit / c + d + k ln n,    weight ~ exp(-AIC / 2)
/// for k parameters, n points, and d = sum 2 ln sigma less that of the sharpest model, where models are taken to know what they
/// say to different resolutions (Burnham and Anderson 2002, sections 2.2, 2.5, 2.9 and 6.4). The runs of the first model are kept
/// in the file that `options` says, those of the others beside it, with a number from 1 after its name.
/// A study that compares none is fitted as it is. Throws as `fit_study` does.
Fit fit_models(const Study& study, const FitOptions& options = {});

/// The study with the scenes of one of its models.
Study model_of(const Study& study, std::size_t model);

}  // namespace crampfit
