#pragma once

#include "datasets/placement.hpp"
#include "imaging/gray_picture.hpp"

#include <functional>

namespace crampfit {

/// The gray of a specimen's wood, as a picture of it shows that, at any place of the specimen [m]; beyond the picture as in its
/// mirror image. `placement.rows` is the picture's. Details that a camera with pixels of `finest` [m] cannot see are taken out.
std::function<double(const Vec2&)> wood_surface(const FinePicture& picture, const Placement& placement, double finest);

/// Whether the picture reaches over a rectangle of this size at the specimen's origin [m], but for a hundredth of it at most.
bool covers(const FinePicture& picture, const Placement& placement, const Vec2& size);

}  // namespace crampfit
