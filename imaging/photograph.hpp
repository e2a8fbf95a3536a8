#pragma once

#include "datasets/experiment.hpp"
#include "imaging/gray_picture.hpp"

namespace crampfit {

/// Reads the file of a photograph and turns it onto the axes of a specimen of this size [m], with a little of what is around it;
/// white where the photograph ends. Does nothing where there is no file. Throws InputError for a picture that cannot be read, is
/// of another size than those that the crack was tracked in, or shows nothing of the specimen.
void load_photograph(Photograph& photograph, const Vec2& size, const PictureKey& asked_by);

/// Reads all pictures that a study names: specimens of all scenes (`load_specimen`) and photographs of experiments.
void load_pictures(Study& study);

}  // namespace crampfit
