#pragma once

#include "datasets/displacement_field.hpp"

namespace crampfit {

/// Fills the strains of a field by least squares: a polynomial of second degree through the displacements of the points
/// around that were followed and can be reached from the point over such points, so that none lies beyond a crack. With
/// points on all sides its slope is that of a plane; at a border it does not take curvature for strain. Not a number
/// where the points around do not determine it.
void add_strain(const PointLattice& lattice, DisplacementField& field);

}  // namespace crampfit
