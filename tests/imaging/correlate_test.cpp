// Displacement fields against pictures whose displacement is known.
#include "imaging/correlate.hpp"
#include "imaging/spline_picture.hpp"
#include "imaging/virtual_camera.hpp"
#include "tests/imaging/plane_fields.hpp"

#include "datasets/error.hpp"

#include <Eigen/Dense>
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
    double bias_u = 0, bias_v = 0;  // [px]
    double worst_displacement = 0;  // root mean square [px]
    double strain = 0;              // root mean square over exx, eyy, exy
    double worst_strain = 0;
    double sigma = 0;  // mean of what the field says of itself [px]
    int followed = 0;
};

/// Against a displacement and its gradient at the points.
Errors compare(const PointLattice& lattice, const DisplacementField& field, const PlaneField& truth) {
    Errors errors;
    double squared = 0, strain_squared = 0;
    int strains = 0;
    for (int point = 0; point < lattice.count(); ++point) {
        const auto i = static_cast<std::size_t>(point);
        if (field.status[i] != PointStatus::ok) continue;
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

/// The least standard error of a subset's displacement (root mean square over u, v and the points), from the slopes of a picture
/// without noise: gray's offset, its gain and the warp are unknown, and both pictures have the noise of their pixels and of
/// rounding [px].
double cramer_rao(const FinePicture& clean, const PointLattice& lattice, int subset, int order, double noise) {
    const SplinePicture::Slopes slopes = SplinePicture(clean).slopes();
    const int half = subset / 2, terms = order == 1 ? 3 : 6;
    double sum = 0;
    for (int point = 0; point < lattice.count(); ++point) {
        Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(2 * terms + 2, 2 * terms + 2);
        for (int j = -half; j <= half; ++j)
            for (int i = -half; i <= half; ++i) {
                const auto at = static_cast<std::size_t>((lattice.y(point) + j) * clean.columns + lattice.x(point) + i);
                const double xi = static_cast<double>(i) / half, eta = static_cast<double>(j) / half;
                const double power[6] = {1, xi, eta, xi * xi, xi * eta, eta * eta};
                Eigen::VectorXd row(2 * terms + 2);
                for (int m = 0; m < terms; ++m) {
                    row[m] = slopes.by_x[at] * power[m];
                    row[terms + m] = slopes.by_y[at] * power[m];
                }
                row.tail<2>() << 1, clean.gray[at] - 128;
                normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
            }
        const Eigen::MatrixXd identity = Eigen::MatrixXd::Identity(2 * terms + 2, 2 * terms + 2);
        const Eigen::MatrixXd covariance =
            2 * (noise * noise + 1.0 / 12) * normal.selfadjointView<Eigen::Lower>().ldlt().solve(identity);
        sum += (covariance(0, 0) + covariance(terms, terms)) / 2;
    }
    return std::sqrt(sum / lattice.count());
}

/// The middle of the picture stays in place.
PlaneField stretched(double by) { return polynomial_field({256, 256}, {by, 0.3 * by, 0, 0, 0}, {-0.4 * by, -0.5 * by, 0, 0, 0}); }

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
                "%d of %d followed\n",
                what, order, noise, errors.bias_u, errors.bias_v, errors.worst_displacement, errors.sigma, 1e6 * errors.strain,
                1e6 * errors.worst_strain, errors.followed, correlator.lattice().count());
    EXPECT_LT(errors.worst_displacement, 0.01);
    EXPECT_LT(errors.strain, 200e-6);
    EXPECT_GT(errors.followed, 0.8 * correlator.lattice().count());  // up to 13 px leave at the sides
}

}  // namespace

// Bars: displacement 0.01 px, strain 200 microstrain.
TEST(VerificationCorrelate, AffineFieldsUpToFivePercent) {
    for (const double strain : {0.001, 0.01, 0.05}) expect_within_bars("affine", stretched(strain), 1, 1.0);
    expect_within_bars("affine", stretched(0.05), 2, 1.0);
}

TEST(VerificationCorrelate, QuadraticFieldsUpToFivePercent) {
    expect_within_bars("quadratic", bent(0.05), 1, 1.0);
    expect_within_bars("quadratic", bent(0.05), 2, 1.0);
}

// The standard error that a point tells of itself is that of the displacements' scatter, for white noise; and no unbiased
// estimate from the same subsets scatters less than the bound of Cramer and Rao, which is met without smoothing and passed by
// half with it: coarse features alone tell less. Where gray varies alike in all of the subset, the parabola's terms of a
// second-order warp take 5 / 4 along x and 5 / 4 along y of what a first-order warp knows of the middle, so that its bound is
// sqrt(3.5) = 1.87 times as high.
TEST(VerificationCorrelate, StandardErrorIsThatOfTheScatter) {
    for (const int order : {1, 2})
        for (const double noise : {1.0, 3.0}) {
            VirtualCameraOptions camera_options;
            const FinePicture clean = fine(VirtualCamera({.noise = 0}).photograph(0));
            camera_options.noise = noise;
            const VirtualCamera camera(camera_options);
            const PlaneField truth = polynomial_field({0, 0}, {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}, {0.3, -0.7});
            for (const double smoothing : {0.0, CorrelateOptions{}.smoothing}) {
                CorrelateOptions options;
                options.step = 16;
                options.order = order;
                options.smoothing = smoothing;
                const Correlator correlator(fine(camera.photograph(0)), {}, options, "reference");
                const Errors errors =
                    compare(correlator.lattice(), correlator.field(fine(camera.photograph(truth.displacement, 1))), truth);
                const double bound = cramer_rao(clean, correlator.lattice(), options.subset, order, noise);
                std::printf("order %d, noise %g, smoothing %g px: scatter %.4f px, said %.4f px, Cramer-Rao %.4f px\n", order,
                            noise, smoothing, errors.worst_displacement, errors.sigma, bound);
                // Interpolation hides a tenth of the noise, and adds some to the slopes.
                EXPECT_NEAR(errors.sigma / errors.worst_displacement, 1.0, 0.15);
                if (smoothing == 0) {
                    EXPECT_NEAR(errors.worst_displacement / bound, 1.0, 0.15);
                }
            }
        }
}

// The public set of shifted speckle pictures; bars: bias 0.005 px, standard deviation 0.01 px. Its pictures are the
// reference resampled by linear interpolation, which shows fine details up to 0.03 px from where they should be.
TEST(VerificationCorrelate, PublicShiftedPictures) {
    const std::filesystem::path folder = std::filesystem::path(SHARED_DATA) / "dic";
    if (!std::filesystem::exists(folder)) GTEST_SKIP() << "there is no " << folder;
    const auto read = [&](const std::string& which) {
        return read_fine_gray(folder / ("trxy_s2_10_" + which + ".tiff"), {"test", "picture"});
    };
    const Correlator correlator(read("ref"), {}, {}, "reference");
    for (int i = 0; i <= 10; ++i) {
        const DisplacementField field = correlator.field(read(std::to_string(i)));
        Eigen::Map<const Eigen::ArrayXd> u(field.u.data(), correlator.lattice().count()),
            v(field.v.data(), correlator.lattice().count());
        const double bias_u = u.mean() + 0.1 * i, bias_v = v.mean();
        const double sd_u = std::sqrt((u - u.mean()).square().mean()), sd_v = std::sqrt((v - v.mean()).square().mean());
        std::printf("shift %.1f px: bias %7.4f %7.4f px, standard deviation %.4f %.4f px\n", 0.1 * i, bias_u, bias_v, sd_u, sd_v);
        EXPECT_LT(std::abs(bias_u), 0.005);  // not a number where a point was lost: the test then fails
        EXPECT_LT(std::abs(bias_v), 0.005);
        EXPECT_LT(sd_u, 0.01);
        EXPECT_LT(sd_v, 0.01);
    }
}

TEST(VerificationCorrelate, SameBitsForAnyNumberOfThreads) {
    const VirtualCamera camera({.columns = 256, .rows = 200});
    const FinePicture reference = fine(camera.photograph(0));
    const FinePicture image = fine(camera.photograph(crack_field({120, 100}, 0.2, 3, 1), 1));
    std::vector<double> alone;
    for (const int threads : {1, 2, 5}) {
        CorrelateOptions options;
        options.threads = threads;
        options.step = 5;
        std::vector<double> u = Correlator(reference, {}, options, "reference").field(image).u;
        std::ranges::replace_if(
            u, [](double value) { return std::isnan(value); }, -1e9);
        if (threads == 1) alone = u;
        EXPECT_EQ(u, alone) << threads << " threads";
    }
}

// What is followed beside an open crack must belong to its side, and a lost point must carry no number.
TEST(VerificationCorrelate, NoPointIsFollowedAcrossACrack) {
    const VirtualCamera camera({.columns = 400, .rows = 300});
    const Correlator correlator(fine(camera.photograph(0)), {}, {}, "reference");
    const PointLattice& lattice = correlator.lattice();
    for (const double opening : {1.0, 4.0, 12.0}) {
        const PlaneDisplacement truth = crack_field({300, 150.5}, 0, opening, 0);
        const DisplacementField field = correlator.field(fine(camera.photograph(truth, 1)));
        double worst = 0;
        int over = 0, over_lost = 0, others = 0, others_lost = 0;
        for (int point = 0; point < lattice.count(); ++point) {
            const auto i = static_cast<std::size_t>(point);
            const bool lost = field.status[i] != PointStatus::ok;
            EXPECT_EQ(lost, std::isnan(field.u[i]));
            EXPECT_EQ(lost, std::isnan(field.v[i]));
            const double above = std::abs(lattice.y(point) - 150.5);
            if (lattice.x(point) < 200 &&
                above < 12) {  // at least an eighth of the subset lies beyond an opening of at least `opening`
                ++over;
                over_lost += lost ? 1 : 0;
            } else if (lattice.x(point) < 200 && above > 16) {
                ++others;
                others_lost += lost ? 1 : 0;
                if (!lost)
                    worst =
                        std::max(worst, (Vec2(field.u[i], field.v[i]) - truth(Vec2(lattice.x(point), lattice.y(point)))).norm());
            }
        }
        std::printf("opening %g px: %d of %d over the crack lost, %d of %d others; worst of the others %.3f px\n", opening,
                    over_lost, over, others_lost, others, worst);
        EXPECT_EQ(over_lost, over);
        EXPECT_LT(others_lost, 0.05 * others);
        EXPECT_LT(worst, 0.05);
    }
}

TEST(UnitCorrelate, NoSubsetReachesOverTheMask) {
    const VirtualCamera camera({.columns = 200, .rows = 150});
    const FinePicture reference = fine(camera.photograph(0));
    std::vector<std::uint8_t> mask(200 * 150, 255);
    for (std::size_t y = 0; y < 150; ++y) mask[y * 200 + 95] = 0;
    const Correlator correlator(reference, mask, {}, "reference");
    const DisplacementField field = correlator.field(reference);
    for (int point = 0; point < correlator.lattice().count(); ++point) {
        const int away = std::abs(correlator.lattice().x(point) - 95);
        const PointStatus expected = away == 0 ? PointStatus::masked : away <= 15 ? PointStatus::across_mask : PointStatus::ok;
        EXPECT_EQ(field.status[static_cast<std::size_t>(point)], expected) << away;
    }
}

TEST(UnitCorrelate, FlatAndUnrelatedPicturesGiveNoPoints) {
    const VirtualCamera camera({.columns = 200, .rows = 150, .noise = 0});
    FinePicture reference = fine(camera.photograph(0));
    for (std::size_t i = 0; i < reference.gray.size(); ++i)
        if (i % 200 < 100) reference.gray[i] = 90;
    const Correlator correlator(reference, {}, {}, "reference");
    const DisplacementField field = correlator.field(reference);
    for (int point = 0; point < correlator.lattice().count(); ++point)
        EXPECT_EQ(field.status[static_cast<std::size_t>(point)],
                  correlator.lattice().x(point) + 15 < 100 ? PointStatus::no_contrast : PointStatus::ok);

    const VirtualCamera other({.columns = 200, .rows = 150, .seed = 2});
    for (const PointStatus status : correlator.field(fine(other.photograph(0))).status) EXPECT_NE(status, PointStatus::ok);
}
