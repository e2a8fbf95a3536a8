#pragma once

#include "forward/elasticity.hpp"

#include <memory>

namespace crampfit {

/// What wood is made of at a place, or on average over an area.
struct LocalWood {
    LayeredElasticity elasticity;
    double density = 0;                  // [kg/m^3]
    double toughness = 0;                // [J/m^2]
    Vec2 poisson_ratios = Vec2::Zero();  // stress out of the plane, in plane strain, per stress along the normal and the layers
    double filled = 0;                   // share of the area that is not void
    double latewood = 0;                 // 0 first material .. 1 last, for pictures
    bool mixed = false;                  // an average over more than one wood
    int material = -1;                   // its number; -1: transition wood, or an average

    /// E' = E in plane stress, E / (1 - nu^2) in plane strain, along the layers [Pa].
    double plane_modulus() const { return elasticity.coefficients[0]; }
};

/// What a part of an area adds to the area's average stiffness, as energy per area of the part. With q (y - y_0) and q (x - x_0)
/// the displacement gradients in x and y by which those in the part's middle change, and e the strain there (xx, yy, 2 xy), it is
/// e . stretch e / 2 + e . coupling q + q . bending q / 2.
struct Unevenness {
    Eigen::Matrix3d stretch = Eigen::Matrix3d::Zero();                           // [Pa]; 0 for the whole area
    Eigen::Matrix<double, 3, 2> coupling = Eigen::Matrix<double, 3, 2>::Zero();  // [Pa m]
    Eigen::Matrix2d bending = Eigen::Matrix2d::Zero();                           // [Pa m^2]

    bool isZero() const { return stretch.isZero(0.0) && coupling.isZero(0.0) && bending.isZero(0.0); }
};

/// An upright rectangle, and which wood lies where in it: the same for all maps whose materials differ in numbers alone, so that
/// it is looked for once.
struct WoodArea {
    Vec2 centre, half;  // [m]
    struct Sample {
        int wood = -1;       // number of the material, or of the first of two; -1: void
        double grade = 0.0;  // of the way from it to the next
        Vec2 radial = Vec2::UnitX();
    };
    std::vector<Sample> samples = {};  // on a square lattice, row by row; none: not asked for yet
};

/// The scene's wood by place: one material, analytic rings, or a picture. Cutouts are not its business.
/// Between EW and LW the density goes linearly and the other constants follow it (`transition_wood`). Orthotropic wood stands as
/// layers across its radial direction.
class MaterialMap {
  public:
    /// Throws InputError for orthotropic wood without a radial direction, for transition wood with inadmissible constants, and
    /// for wood that remembers where there is transition or orthotropic wood.
    explicit MaterialMap(const Scene& scene);

    /// The same wood as a part of the specimen sees it that has its lower left corner there. What rectangles hold on average is
    /// found once for all such parts, whichever comes first, places counting to a thousandth of the rectangle; several threads
    /// may ask.
    MaterialMap part(const Vec2& corner) const;

    /// At a place. Outside a picture the nearest pixel counts, so that rounding at the edge costs no points.
    LocalWood at(const Vec2& x) const;

    /// Whether there is any at a place.
    bool has_wood_at(const Vec2& x) const;

    /// Whether a picture or a specimen's file says what is at a place; everywhere where there is none.
    bool is_seen(const Vec2& x) const;

    /// Averaged over an upright rectangle: elasticity as layers across the direction in which the wood changes most, the rest by
    /// area.
    LocalWood average(WoodArea& area) const;
    LocalWood average(const Vec2& centre, const Vec2& half) const;

    /// Of a full rectangle in a cell of this `average`; all zero where its wood is the average's. Layers share the strain along
    /// them, wherever they lie, and the tractions between them are those of the mean strain: the part that q stretches along the
    /// layers feels the moments of E', r and p (`LayeredElasticity`), the rest the average. Places count with their distance from
    /// the middle times `spread`, so that the points which integrate the average have the same second moment. With a spread of 1
    /// it is a whole cell, whose average resists q by its `uniaxial_moduli` alone, with sides free to curve.
    Unevenness unevenness(WoodArea& area, const LocalWood& average, const Vec2& spread) const;

    bool homogeneous() const { return homogeneous_; }
    bool orthotropic() const { return orthotropic_; }  // some of it
    bool remembers() const { return remembers_; }      // some of it

    const std::vector<Material>& materials() const { return materials_; }  // by number

    /// What part of the wood in an upright rectangle each material is, by number.
    std::vector<double> shares(const Vec2& centre, const Vec2& half) const;

  private:
    struct Known;
    class Transition;
    WoodArea::Sample sample_at(const Vec2& x) const;
    LocalWood wood_of(const WoodArea::Sample& sample) const;
    WoodArea in_specimen(WoodArea& area) const;
    int sample(WoodArea& area) const;
    LocalWood find_average(WoodArea& area) const;
    Unevenness find_unevenness(WoodArea& area, const LocalWood& average, const Vec2& spread) const;
    LocalWood mix(int first, int second, double grade) const;
    void check_radial_direction() const;
    void check_transition(int first) const;
    void check_memory(bool graded) const;
    int samples_a_side(const Vec2& half) const;
    Vec2 radial_direction(const Vec2& x) const;
    Vec2 layer_normal(const Vec2& centre, const Vec2& half) const;
    void average_elasticity(const std::vector<LayeredElasticity>& samples, int side, const std::optional<Vec2>& normal,
                            LayeredElasticity& mean) const;
    const LocalWood* band_around(const Vec2& centre, const Vec2& half) const;
    WoodArea::Sample in_rings(const Vec2& x) const;
    Vec2 in_pixels(const Vec2& x) const;
    std::size_t pixel_at(const Vec2& x) const;
    WoodArea::Sample in_picture(const Vec2& x) const;

    const Scene& scene_;
    std::vector<Material> materials_;  // in the order of labels
    std::vector<LocalWood> pure_;      // the same, ready made
    std::vector<std::shared_ptr<const Transition>>
        transition_;                      // [materials - 1] from each to the next; none: wood is not graded
    Vec2 picture_offset_ = Vec2::Zero();  // [m]
    double picture_cos_ = 1.0;
    double picture_sin_ = 0.0;
    double finest_ = 0.0;           // size of the finest detail to average over [m]; 0: none
    Vec2 corner_ = Vec2::Zero();    // of what places count from, in the specimen [m]
    std::shared_ptr<Known> known_;  // of all parts
    bool is_part_ = false;
    bool homogeneous_ = true;
    bool orthotropic_ = false;
    bool remembers_ = false;
};

}  // namespace crampfit
