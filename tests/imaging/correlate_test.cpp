// Displacement fields against pictures whose displacement is known.
#include "imaging/correlate.hpp"
#include "imaging/spline_picture.hpp"
#include "imaging/virtual_camera.hpp"
#include "tests/imaging/pictures.hpp"
#include "tests/imaging/plane_fields.hpp"

#include "datasets/error.hpp"

#include <Eigen/Dense>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numbers>
#include <optional>
#include <random>

using namespace crampfit;
using namespace crampfit::test;

namespace {

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

/// A pattern of cosine waves, six to twenty pixels long: its gray is known at any place, so that any picture of it is exact up to
/// noise of one gray and rounding.
class Waves {
  public:
    explicit Waves(unsigned seed = 1) {
        std::mt19937 random(seed);
        std::uniform_real_distribution<> part(0, 1);
        for (int i = 0; i < 60; ++i) {
            const double length = 6 + 14 * part(random), direction = 2 * std::numbers::pi * part(random);
            waves_.push_back({2 * std::numbers::pi / length * Vec2(std::cos(direction), std::sin(direction)),
                              2 * std::numbers::pi * part(random)});
        }
    }

    /// `material` gives the place of the reference that a place of the picture shows, or none in a gap.
    FinePicture picture(const std::function<std::optional<Vec2>(const Vec2&)>& material, unsigned shot) const {
        std::mt19937 random(100 + shot);
        std::normal_distribution<> noise(0, 1);
        FinePicture picture{columns, rows, {}};
        for (int y = 0; y < rows; ++y)
            for (int x = 0; x < columns; ++x) {
                const std::optional<Vec2> place = material(Vec2(x, y));
                double gray = place ? 128 : 15;
                if (place)
                    for (const auto& [number, phase] : waves_) gray += 6 * std::cos(number.dot(*place) + phase);
                picture.gray.push_back(static_cast<float>(std::clamp(std::round(gray + noise(random)), 0.0, 255.0)));
            }
        return picture;
    }

    FinePicture reference() const {
        return picture([](const Vec2& place) { return std::optional(place); }, 0);
    }

    static constexpr int columns = 300, rows = 260;

  private:
    struct Wave {
        Vec2 number;  // [rad/px]
        double phase;
    };
    std::vector<Wave> waves_;
};

/// Whether all of a subset that moves as a whole, turned or not, is in the picture.
bool stays_in(const Vec2& middle) {
    constexpr double reach = 23;  // half the diagonal of a subset, and a pixel
    return middle.x() > reach && middle.x() < Waves::columns - reach && middle.y() > reach && middle.y() < Waves::rows - reach;
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
// half with it: coarse features alone tell less. Strong noise is in the slopes, too, and passes it by more. Where gray varies
// alike in all of the subset, the parabola's terms of a second-order warp take 5 / 4 along x and 5 / 4 along y of what a
// first-order warp knows of the middle, so that its bound is sqrt(3.5) = 1.87 times as high.
TEST(VerificationCorrelate, StandardErrorIsThatOfTheScatter) {
    for (const int order : {1, 2})
        for (const double noise : {1.0, order == 1 ? 12.0 : 3.0}) {
            VirtualCameraOptions camera_options;
            const FinePicture clean = fine(VirtualCamera({.noise = 0}).photograph(0));
            camera_options.noise = noise;
            const VirtualCamera camera(camera_options);
            const PlaneField truth = polynomial_field({0, 0}, {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}, {0.3, -0.7});
            for (const std::optional<double> smoothing : {std::optional(0.0), std::optional<double>()}) {
                CorrelateOptions options;
                options.step = 16;
                options.order = order;
                options.smoothing = smoothing;
                const Correlator correlator(fine(camera.photograph(0)), {}, options, "reference");
                const Errors errors =
                    compare(correlator.lattice(), correlator.field(fine(camera.photograph(truth.displacement, 1))), truth);
                const double bound = cramer_rao(clean, correlator.lattice(), options.subset, order, noise);
                std::printf("order %d, noise %g, smoothing %g px: scatter %.4f px, said %.4f px, Cramer-Rao %.4f px\n", order,
                            noise, smoothing.value_or(smoothing_for(fine(camera.photograph(0)))), errors.worst_displacement,
                            errors.sigma, bound);
                // Interpolation hides a tenth of the noise, and adds some to the slopes.
                EXPECT_NEAR(errors.sigma / errors.worst_displacement, 1.0, 0.15);
                EXPECT_GT(errors.worst_displacement / bound, 0.85);
                if (smoothing && noise < 10) {
                    EXPECT_LT(errors.worst_displacement / bound, 1.15);
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

// Parts that have moved away from each other by more than a subset are both followed, wherever they are.
TEST(VerificationCorrelate, HalvesThatACrackHasParted) {
    const Waves waves;
    const Correlator correlator(waves.reference(), {}, {}, "reference");
    const PointLattice& lattice = correlator.lattice();
    const double crack = 130.3;
    for (const double apart : {30.0, 50.0, 80.0}) {
        const auto material = [&](const Vec2& place) -> std::optional<Vec2> {
            if (place.y() < crack - apart / 2) return place + Vec2(0, apart / 2);
            if (place.y() > crack + apart / 2) return place - Vec2(0, apart / 2);
            return std::nullopt;
        };
        const DisplacementField field = correlator.field(waves.picture(material, 1));
        for (int point = 0; point < lattice.count(); ++point) {
            const auto i = static_cast<std::size_t>(point);
            const Vec2 place(lattice.x(point), lattice.y(point));
            const double v = place.y() < crack ? -apart / 2 : apart / 2;
            if (std::abs(place.y() - crack) < 17 || !stays_in(place + Vec2(0, v))) continue;
            ASSERT_EQ(field.status[i], PointStatus::ok) << apart << " px, at " << place.transpose();
            EXPECT_NEAR(field.v[i], v, 0.05);
        }
    }
}

// What has left the picture is told, and is not sought in all of it.
TEST(VerificationCorrelate, ShiftedByAThirdOfThePicture) {
    const Waves waves;
    const Correlator correlator(waves.reference(), {}, {}, "reference");
    const PointLattice& lattice = correlator.lattice();
    const DisplacementField field =
        correlator.field(waves.picture([](const Vec2& place) { return std::optional<Vec2>(place + Vec2(100.25, 0)); }, 1));
    for (int point = 0; point < lattice.count(); ++point) {
        const bool left = lattice.x(point) - 100.25 - 15 < 0;
        EXPECT_EQ(field.status[static_cast<std::size_t>(point)], left ? PointStatus::left_picture : PointStatus::ok);
    }
}

TEST(VerificationCorrelate, TurnedByMoreThanASubsetIsFoundAt) {
    const Waves waves;
    const Correlator correlator(waves.reference(), {}, {}, "reference");
    const PointLattice& lattice = correlator.lattice();
    const Vec2 middle(Waves::columns / 2, Waves::rows / 2);
    for (const double degrees : {20.0, 26.0}) {
        const Eigen::Rotation2D<double> turn(degrees * std::numbers::pi / 180);
        const DisplacementField field = correlator.field(
            waves.picture([&](const Vec2& place) { return std::optional<Vec2>(middle + turn.inverse() * (place - middle)); }, 1));
        for (int point = 0; point < lattice.count(); ++point) {
            const auto i = static_cast<std::size_t>(point);
            const Vec2 place(lattice.x(point), lattice.y(point)), moved = middle + turn * (place - middle);
            if (!stays_in(moved)) continue;
            ASSERT_EQ(field.status[i], PointStatus::ok) << degrees << " degrees, at " << place.transpose();
            EXPECT_LT((Vec2(field.u[i], field.v[i]) - (moved - place)).norm(), 0.05);
        }
    }
}

// Subsets of fine spots are recognised only where they are turned nearly right. Points whose subset, turned, stays in the
// picture.
TEST(VerificationCorrelate, FineSpotsAreFoundTurned) {
    for (const double spot : {1.0, 1.6, 3.0}) {
        VirtualCameraOptions camera_options;
        camera_options.columns = camera_options.rows = 240;
        camera_options.spot_radius = spot;
        const VirtualCamera camera(camera_options);
        const Vec2 middle(120, 120);
        for (const int subset : {21, 31}) {
            if (subset < 8 * spot) continue;  // too few spots to know a turn by
            CorrelateOptions options;
            options.subset = subset;
            const Correlator correlator(fine(camera.photograph(0)), {}, options, "reference");
            const PointLattice& lattice = correlator.lattice();
            for (const double degrees : {-26.0, -17.0, -13.0, 15.0, 19.0, 24.0}) {
                const Eigen::Rotation2D<double> turn(degrees * std::numbers::pi / 180);
                const auto move = [&](const Vec2& place) { return Vec2(middle + turn * (place - middle) - place); };
                const DisplacementField field = correlator.field(fine(camera.photograph(move, 1)));
                int inside = 0, found = 0;
                for (int point = 0; point < lattice.count(); ++point) {
                    const Vec2 place(lattice.x(point), lattice.y(point));
                    if ((place + move(place) - middle).cwiseAbs().maxCoeff() + 0.75 * subset > 120) continue;
                    const auto i = static_cast<std::size_t>(point);
                    ++inside;
                    found += field.status[i] == PointStatus::ok && (Vec2(field.u[i], field.v[i]) - move(place)).norm() < 0.1;
                }
                EXPECT_GT(found, 0.98 * inside)
                    << "spots of " << spot << " px, subset " << subset << ", " << degrees << " degrees";
            }
        }
    }
}

// A frame that a camera dropped is one picture lost among others.
TEST(UnitCorrelate, NothingIsFollowedInAPictureOfOneGray) {
    const VirtualCamera camera({.columns = 120, .rows = 120});
    const Correlator correlator(fine(camera.photograph(0)), {}, {}, "reference");
    FinePicture black = fine(camera.photograph(1));
    std::ranges::fill(black.gray, 0.0f);
    EXPECT_NO_THROW(correlator.check(black, "black.png"));
    EXPECT_EQ(std::ranges::count(correlator.field(black).status, PointStatus::no_contrast), correlator.lattice().count());
    EXPECT_THROW(Correlator(black, {}, {}, "black.png"), InputError);
}

// A few pixels that show something else are no crack.
TEST(VerificationCorrelate, NothingMovesApartInARigidMotion) {
    const Waves waves;
    const auto shifted = [](const Vec2& place) { return std::optional<Vec2>(place - Vec2(0.25, -0.37)); };
    FinePicture reference = waves.reference(), image = waves.picture(shifted, 1), dim = image;
    for (float& gray : dim.gray) gray = std::round(0.6f * gray + 20);
    std::mt19937 random(5);
    std::uniform_int_distribution<std::size_t> any(0, reference.gray.size() - 1);
    for (int i = 0; i < 16; ++i) {
        const std::size_t hot = any(random);
        reference.gray[hot] = image.gray[hot] = 255;
    }
    const Correlator correlator(reference, {}, {}, "reference");
    for (const FinePicture& seen : {image, dim}) {
        const DisplacementField field = correlator.field(seen);
        EXPECT_EQ(std::ranges::count(field.status, PointStatus::ok), correlator.lattice().count());
    }
}

// A camera of ten bits that writes them into sixteen makes a dark picture, whose grays are finer than the 255th of white.
TEST(VerificationCorrelate, TenBitsInAFileOfSixteen) {
    const Waves waves;
    const auto ten_bits = [](FinePicture picture) {
        for (float& gray : picture.gray) gray = std::round(4 * gray) / 257;
        return picture;
    };
    const Correlator correlator(ten_bits(waves.reference()), {}, {}, "reference");
    const DisplacementField field = correlator.field(
        ten_bits(waves.picture([](const Vec2& place) { return std::optional<Vec2>(place - Vec2(0.25, -0.37)); }, 1)));
    for (int point = 0; point < correlator.lattice().count(); ++point)
        ASSERT_EQ(field.status[static_cast<std::size_t>(point)], PointStatus::ok);
}

// Fine patterns are smoothed less than coarse ones: whatever the spots, scatter stays within 1.6 times the bound of Cramer and
// Rao.
TEST(VerificationCorrelate, SmoothingIsThatOfThePattern) {
    for (const double spot : {1.0, 1.6, 2.5}) {
        VirtualCameraOptions options{.columns = 300, .rows = 260, .spot_radius = spot, .noise = 0};
        const FinePicture clean = fine(VirtualCamera(options).photograph(0));
        options.noise = 2;
        const VirtualCamera camera(options);
        const PlaneField truth = polynomial_field({0, 0}, {0, 0, 0, 0, 0}, {0, 0, 0, 0, 0}, {0.25, -0.37});
        const Correlator correlator(fine(camera.photograph(0)), {}, {}, "reference");
        const Errors errors =
            compare(correlator.lattice(), correlator.field(fine(camera.photograph(truth.displacement, 1))), truth);
        const double bound = cramer_rao(clean, correlator.lattice(), CorrelateOptions().subset, 1, 2);
        std::printf("spots of %.1f px: smoothing %.2f px, scatter %.4f px, Cramer-Rao %.4f px, bias %.4f %.4f px\n", spot,
                    smoothing_for(fine(camera.photograph(0))), errors.worst_displacement, bound, errors.bias_u, errors.bias_v);
        EXPECT_LT(errors.worst_displacement, 1.6 * bound);
        EXPECT_LT(std::hypot(errors.bias_u, errors.bias_v), 0.005);
    }
}

TEST(UnitVirtualCamera, OptionsAreNamedAsOnTheCommandLine) {
    const auto message = [](const VirtualCameraOptions& options) -> std::string {
        try {
            options.validate();
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_NE(message({.noise = -1}).find("command line: --noise"), std::string::npos) << message({.noise = -1});
    EXPECT_NE(message({.spot_radius = 0}).find("command line: --spot"), std::string::npos);
    EXPECT_NE(message({.columns = 0}).find("virtual camera: columns"), std::string::npos);
}
