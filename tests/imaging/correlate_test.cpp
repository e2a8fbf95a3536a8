// Displacement fields against pictures whose displacement is known.
#include "imaging/correlate.hpp"
#include "imaging/virtual_camera.hpp"
#include "tests/imaging/plane_fields.hpp"

#include "datasets/error.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>

using namespace crampfit;

namespace {

FinePicture fine(const GrayPicture& picture) {
    return {picture.columns, picture.rows, {picture.gray.begin(), picture.gray.end()}};
}

struct Errors {
    double bias_u = 0, bias_v = 0;    // [px]
    double worst_displacement = 0;    // root mean square [px]
    double strain = 0;                // root mean square over exx, eyy, exy
    double worst_strain = 0;
    double sigma = 0;                 // mean of what the field says of itself [px]
    int followed = 0;
};

/// Against a displacement and its gradient at the points.
Errors compare(const PointLattice& lattice, const DisplacementField& field, const PlaneField& truth) {
    Errors errors;
    double squared = 0, strain_squared = 0;
    int strains = 0;
    for (int point = 0; point < lattice.count(); ++point) {
        const auto i = static_cast<std::size_t>(point);
        if (field.status[i] != PointStatus::ok)
            continue;
        const Vec2 place(lattice.x(point), lattice.y(point));
        const Vec2 error = Vec2(field.u[i], field.v[i]) - truth.displacement(place);
        ++errors.followed;
        errors.bias_u += error.x();
        errors.bias_v += error.y();
        squared += error.squaredNorm() / 2;
        errors.sigma += field.sigma[i];
        const Eigen::Matrix2d gradient = truth.gradient(place);
        for (const double difference : {field.exx[i] - gradient(0, 0), field.eyy[i] - gradient(1, 1),
                                        field.exy[i] - (gradient(0, 1) + gradient(1, 0)) / 2}) {
            strain_squared += difference * difference;
            errors.worst_strain = std::max(errors.worst_strain, std::abs(difference));
            ++strains;
        }
    }
    errors.bias_u /= errors.followed;
    errors.bias_v /= errors.followed;
    errors.sigma /= errors.followed;
    errors.worst_displacement = std::sqrt(squared / errors.followed);
    errors.strain = std::sqrt(strain_squared / strains);
    return errors;
}

/// The middle of the picture stays in place.
PlaneField stretched(double by) {
    return polynomial_field({256, 256}, {by, 0.3 * by, 0, 0, 0}, {-0.4 * by, -0.5 * by, 0, 0, 0});
}

/// Strain rises to `most` at the picture's right side.
PlaneField bent(double most) {
    return polynomial_field({0, 256}, {0, 0, most / 1024, 0, 0}, {0, -0.3 * most, 0, -0.2 * most / 512, 0.3 * most / 1024});
}

void expect_within_bars(const char* what, const PlaneField& truth, int order, double noise) {
    VirtualCameraOptions camera_options;
    camera_options.noise = noise;
    const VirtualCamera camera(camera_options);
    CorrelateOptions options;
    options.order = order;
    const Correlator correlator(fine(camera.photograph(0)), {}, options, "reference");
    const DisplacementField field = correlator.field(fine(camera.photograph(truth.displacement, 1)));
    const Errors errors = compare(correlator.lattice(), field, truth);
    std::printf("%s, order %d, noise %g: bias %.4f %.4f px, rms %.4f px (said: %.4f); strain rms %.0f, worst %.0f microstrain; "
                "%d of %d followed\n", what, order, noise, errors.bias_u, errors.bias_v, errors.worst_displacement, errors.sigma,
                1e6 * errors.strain, 1e6 * errors.worst_strain, errors.followed, correlator.lattice().count());
    EXPECT_LT(errors.worst_displacement, 0.01);
    EXPECT_LT(errors.strain, 200e-6);
    EXPECT_GT(errors.followed, 0.8 * correlator.lattice().count());  // up to 13 px leave at the sides
}

}  // namespace

// Bars: displacement 0.01 px, strain 200 microstrain.
TEST(VerificationCorrelate, AffineFieldsUpToFivePercent) {
    for (const double strain : {0.001, 0.01, 0.05})
        expect_within_bars("affine", stretched(strain), 1, 1.0);
    expect_within_bars("affine", stretched(0.05), 2, 1.0);
}

TEST(VerificationCorrelate, QuadraticFieldsUpToFivePercent) {
    expect_within_bars("quadratic", bent(0.05), 1, 1.0);
    expect_within_bars("quadratic", bent(0.05), 2, 1.0);
}

// The standard error that a point tells of itself is that of the displacements' scatter, for white noise.
TEST(VerificationCorrelate, StandardErrorIsThatOfTheScatter) {
    for (const double noise : {1.0, 3.0}) {
        VirtualCameraOptions camera_options;
        camera_options.noise = noise;
        const VirtualCamera camera(camera_options);
        const PlaneField truth = polynomial_field({0, 0}, {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}, {0.3, -0.7});
        CorrelateOptions options;
        options.step = 16;
        const Correlator correlator(fine(camera.photograph(0)), {}, options, "reference");
        const Errors errors = compare(correlator.lattice(), correlator.field(fine(camera.photograph(truth.displacement, 1))), truth);
        std::printf("noise %g: scatter %.4f px, said %.4f px\n", noise, errors.worst_displacement, errors.sigma);
        EXPECT_NEAR(errors.sigma / errors.worst_displacement, 1.0, 0.1);  // of some 900 points that overlap little
    }
}
