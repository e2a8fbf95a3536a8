#pragma once

#include "datasets/crack_track.hpp"
#include "datasets/displacement_field.hpp"
#include "imaging/silhouette.hpp"

#include <optional>

namespace crampfit {

/// The picture that a field was measured on, as far as finding a tip needs it.
struct FieldGeometry {
    PointLattice lattice;
    int subset = 0;   // edge [px]
    int columns = 0;  // of the picture [px]
    int rows = 0;
    const Silhouette& silhouette;
};

/// Finds the tip of a straight crack that has entered the picture from one of its sides. Around the tip of a crack the
/// displacement is a series in r^(n/2), r the distance from the tip (Williams 1957, eq. 22 and what follows): for each
/// n the angular functions are cos and sin of n theta / 2 and of (n / 2 - 2) theta, and only those of odd n jump across
/// the crack. Each component of the displacement is given all of them up to n = 4 by itself, and up to n = 6 where that
/// explains more than noise, so that no elastic constant is needed and orthotropic wood fits about as well. The place of the tip
/// and the crack's direction are what leaves the smallest sum of squares: sought on a coarse grid over the whole field, then in
/// turn by finer angles and by Levenberg-Marquardt for the tip, at last over a disc around it. Subsets that reach over the crack
/// or the tip take no part. Where that line misses most of the subsets that were torn, as in strongly layered wood, the crack is
/// laid through these and ends with the last of them; how far the tip may be from there is told by how the faces close. The
/// standard error includes what another disc would say, and that of the length the direction's.
CrackTip find_crack_tip(const FieldGeometry& geometry, const DisplacementField& field);

/// How far the two sides of a crack that was seen otherwise have moved apart, at most, as a field shows it [px]; none where
/// nothing was followed on both.
std::optional<double> motion_apart(const FieldGeometry& geometry, const DisplacementField& field, const CrackTip& crack);

}  // namespace crampfit
