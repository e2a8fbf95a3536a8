#pragma once

#include <optional>
#include <vector>

namespace crampfit {

/// What is measured across a crack's line, at every pixel along it: the crack to the left, sound wood to the right.
struct OpeningProfile {
    std::vector<double> opening;  // [px]
    std::vector<double> along,
        across;  // by how much it changes when the wood lies a pixel further along or across the line than was thought
};

/// Where a crack's opening begins.
struct OpeningStart {
    double place = 0;  // along the crack [px]
    double sigma = 0;  // [px]
};

/// The tip of a crack from its opening: a r^p + b r^(p + 1) behind the tip, r the distance to it, nothing ahead, all blurred as a
/// lens does, and what small motions of the wood that are not known make of it. Linear elasticity has p = 1/2 (Williams 1957), a
/// wedge 1, a cohesive zone 3/2 (Barenblatt 1962), a cut 0: none is taken for granted, and the tip is the mean over all powers
/// and places, each weighted by its likelihood. Tukey's weights keep single outliers from steering it. None where an opening
/// explains the profile no better than chance does.
std::optional<OpeningStart> find_opening_start(const OpeningProfile& profile);

}  // namespace crampfit
