#pragma once

#include "datasets/scene.hpp"
#include "datasets/specimen.hpp"

namespace crampfit {

/// Reads a picture and turns its grays into material classes, as a scene asks. Colour is turned to gray (BT.601
/// weights, as OpenCV does), 16 bit to 8 bit. Throws InputError for a missing file, no picture, a gray that no class
/// covers, and so on.
Specimen read_picture(const Picture& picture);

/// Fills `scene.specimen.map` from the scene's picture or specimen file; does nothing for a scene without one.
void load_specimen(Scene& scene);

}  // namespace crampfit
