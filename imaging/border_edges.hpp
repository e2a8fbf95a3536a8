#pragma once

#include "imaging/border_line.hpp"

#include <optional>
#include <vector>

namespace crampfit {

/// Gray at a ring border as it would be without the picture's blur: where one ring's LW ends and the next one's EW begins.
struct BorderGrays {
    double latewood = 0, earlywood = 0;

    BorderGrays& operator+=(const BorderGrays& other) {
        latewood += other.latewood;
        earlywood += other.earlywood;
        return *this;
    }
    BorderGrays operator/(double by) const { return {latewood / by, earlywood / by}; }
};

/// What a picture shows on both sides of its ring borders. Wood grows from LW to EW at once, so that a border also tells how
/// blurred the picture is: gray at a signed distance d from it, towards the bark, is taken as the blur (a Gaussian) of a jump
/// between two lines,
///     (l0 + l1 d) Phi(-d / s) - l1 s phi(d / s) + (e0 + e1 d) Phi(d / s) + e1 s phi(d / s),
/// Phi being the normal distribution and phi its density. l0, l1, e0 and e1 are fitted to each stretch of a border by least
/// squares, the blur s and the jump's place against the border's line to all stretches together. Under noise the rows beside a
/// border tell slopes badly, and what these are off by, l0 and e0 are off, too; so all rings of a picture then have the same
/// slopes, as shares of their width: the medians.
class BorderEdges {
  public:
    /// `gray` and `valid` (0 or 1, float) in the growth frame; a stretch is `ring_width` [pixels] long, 40 at least.
    BorderEdges(const cv::Mat& gray, const cv::Mat& valid, const std::vector<BorderLine>& borders, double ring_width);

    /// None where a border is not seen.
    std::optional<BorderGrays> at(std::size_t border, int column) const;

    double blur() const { return blur_; }    // s, standard deviation [pixels]
    double place() const { return place_; }  // of the jump, from the border's line towards the bark [pixels]

  private:
    /// Mean gray over the distance from a stretch of border.
    struct Stretch {
        double column = 0;             // its middle
        double reach = 0;              // [pixels], to either side
        double before = 0, after = 0;  // widths of the rings on either side [pixels]
        std::vector<double> sum;
        std::vector<int> count;

        double distance(std::size_t bin) const;
        void narrow(double to);  // its reach, where it is larger [pixels]
    };
    struct Fit {
        double latewood = 0, latewood_slope = 0, earlywood = 0, earlywood_slope = 0;  // l0, l1, e0, e1 [gray, gray per pixel]
        double left = 0;                                                              // sum of squares [gray^2]
    };

    static Fit fit(const Stretch& stretch, double blur, double place);
    BorderGrays ends(const Stretch& stretch) const;
    double left(double blur, double place) const;

    std::vector<std::vector<Stretch>> stretches_;  // of each border
    double blur_ = 1, place_ = 0;
    double latewood_slope_ = 0, earlywood_slope_ = 0;  // [gray per ring]
};

}  // namespace crampfit
