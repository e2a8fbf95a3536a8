#include "imaging/crack_tip.hpp"

#include "imaging/subset.hpp"

#include <Eigen/Dense>

#include <algorithm>
#include <array>
#include <cmath>
#include <initializer_list>
#include <iterator>
#include <limits>
#include <numbers>
#include <optional>
#include <utility>
#include <vector>

namespace crampfit {
namespace {

constexpr int terms = 14;           // of the series up to n = 4, for each component
constexpr int more_terms = 22;      // up to n = 6
constexpr int smooth_terms = 10;    // of a polynomial of third degree
constexpr double unit = 100;        // length that r is counted in, so that the terms are of like size [px]
constexpr int scan_points = 500;    // of the field that take part in the coarse search
constexpr int scan_places = 13;     // along the longer side of the field
constexpr int scan_angles = 16;     // around the circle
constexpr int ring_subsets = 6;     // outer radius of the ring about the tip, in subsets
constexpr double other_ring = 1.5;  // factor to rings that tell how much the tip depends on it
template <int count>
constexpr int least_points = 4 * count + 4;  // of the series' terms
// Of the F statistic. Points are neighbours and so depend on each other, and the best of many places is taken: fields
// without a crack reach some 10.
constexpr double least_gain = 50;
constexpr double most_torn = 0.7;      // share of the torn subsets that the crack must have torn
constexpr std::size_t least_torn = 8;  // of them, beside each other, that say anything
constexpr double strained = 4.0;  // reach of the strain about the tip that tears a subset, in half widths of one: a judgement

constexpr double torn_behind = 2.0;  // half widths behind the tip, up to which a crack that has opened there must have torn

// Of the search for the tip.
constexpr int most_iterations = 40;
constexpr double difference_step = 0.1;  // [px]
constexpr double longest_step = 30;      // [px]
constexpr double settled = 1e-3;         // [px]
constexpr double most_damping = 1e8;
constexpr double as_good = 1.1;  // a score by that factor above the best may be chance
constexpr double widest_turn = 60.0 * std::numbers::pi / 180.0;

template <int count>
using Term = Eigen::RowVector<double, count>;
using Displacements = Eigen::Matrix<double, Eigen::Dynamic, 2>;
/// On the stack, but in loops: factors of a fixed size are unrolled by the compiler, which takes half a minute over them.
template <int count, int columns>
using Small = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::ColMajor, count, columns>;

struct Sample {
    Vec2 place;         // [px]
    Vec2 displacement;  // [px]
    double sigma;       // standard error of either of its components [px]
};

/// A straight crack: its tip and the direction that it points in.
struct Line {
    Vec2 tip;
    double angle;

    Vec2 direction() const { return {std::cos(angle), std::sin(angle)}; }
    Vec2 local(const Vec2& place) const {
        const Vec2 d = direction(), offset = place - tip;
        return {d.dot(offset), d.x() * offset.y() - d.y() * offset.x()};
    }
};

/// All terms of the series at a place, the tip at the origin and the crack along the negative x axis.
template <int count>
Term<count> series(const Vec2& place) {
    static_assert(count == terms || count == more_terms);
    const double r = place.norm() / unit;
    if (r == 0) return Term<count>::Zero();
    // cos and sin of multiples of theta / 2 without an angle: half angles by their squares, others by sums.
    const double c = place.x() / (r * unit), s = place.y() / (r * unit);
    const double ch = std::sqrt(std::max(0.0, (1 + c) / 2)), sh = std::copysign(std::sqrt(std::max(0.0, (1 - c) / 2)), s);
    const double c3 = c * ch - s * sh, s3 = s * ch + c * sh;
    const double c2 = c * c - s * s, s2 = 2 * s * c;
    const double root = std::sqrt(r), root3 = r * root;
    Term<count> term;
    term.template head<terms>() << 1, root * ch, root * sh, root * c3, root * s3, r * c, r * s, root3 * c3, root3 * s3,
        root3 * ch, root3 * sh, r * r, r * r * c2, r * r * s2;
    if constexpr (count == more_terms) {
        const double root5 = r * root3, r3 = r * r * r;
        const double c5 = c2 * ch - s2 * sh, s5 = s2 * ch + c2 * sh;
        term.template tail<more_terms - terms>() << root5 * c5, root5 * s5, root5 * ch, root5 * sh, r3 * (c2 * c - s2 * s),
            r3 * (s2 * c + c2 * s), r3 * c, r3 * s;
    }
    return term;
}

/// Half the width of the strip about a crack in which subsets reach over it [px].
double clearance(int subset, double angle) { return 0.5 * subset * (std::abs(std::cos(angle)) + std::abs(std::sin(angle))) + 1; }

/// Whether a subset reaches over the crack or its tip; `local` is its place from the tip.
bool reaches_over(const Vec2& local, double width) {
    return local.norm() < width || (local.x() < 0 && std::abs(local.y()) < width);
}

std::vector<Sample> within(const std::vector<Sample>& samples, const Vec2& tip, double radius) {
    std::vector<Sample> near;
    std::ranges::copy_if(samples, std::back_inserter(near),
                         [&](const Sample& sample) { return (sample.place - tip).norm() < radius; });
    return near;
}

/// Samples whose subsets reach neither over the crack nor over its tip.
std::vector<Sample> clear_of(const std::vector<Sample>& samples, const Line& line, int subset) {
    const double width = clearance(subset, line.angle);
    std::vector<Sample> clear;
    std::ranges::copy_if(samples, std::back_inserter(clear),
                         [&](const Sample& sample) { return !reaches_over(line.local(sample.place), width); });
    return clear;
}

/// What the series with its best coefficients leaves of the displacements [px].
template <int count>
Displacements residuals(const std::vector<Sample>& samples, const Line& line) {
    Eigen::MatrixXd rows(samples.size(), count);
    Displacements right(samples.size(), 2);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
        const Sample& sample = samples[static_cast<std::size_t>(i)];
        rows.row(i) = series<count>(line.local(sample.place));
        right.row(i) = sample.displacement.transpose();
    }
    return right - rows * rows.householderQr().solve(right);
}

/// Mean square of what is left, for each degree of freedom [px^2]; by normal equations, quick and exact enough to
/// compare. Points nearer to the tip than `about_tip` and to the crack than `about_crack` take no part [px].
template <int count>
double scan_score(const std::vector<Sample>& samples, const Line& line, double about_tip, double about_crack) {
    Small<count, count> normal = Small<count, count>::Zero(count, count);
    Small<count, 2> right = Small<count, 2>::Zero(count, 2);
    double squares = 0;
    int points = 0;
    for (const Sample& sample : samples) {
        const Vec2 local = line.local(sample.place);
        if (local.norm() < about_tip || (local.x() < 0 && std::abs(local.y()) < about_crack)) continue;
        const Term<count> term = series<count>(local);
        normal.template selfadjointView<Eigen::Lower>().rankUpdate(term.transpose());
        right += term.transpose() * sample.displacement.transpose();
        squares += sample.displacement.squaredNorm();
        ++points;
    }
    if (points < least_points<count>) return std::numeric_limits<double>::infinity();
    const auto factor = normal.template selfadjointView<Eigen::Lower>().ldlt();
    const double left = squares - right.cwiseProduct(factor.solve(right)).sum();
    return std::isfinite(left) ? left / (2 * (points - count)) : std::numeric_limits<double>::infinity();
}

/// Places whose subsets were torn, as a crack does it: many beside each other. Others are lost here and there, and at the
/// specimen's edges.
std::vector<Vec2> torn_places(const FieldGeometry& geometry, const DisplacementField& field) {
    const PointLattice& lattice = geometry.lattice;
    const std::vector<bool> at_edge = geometry.silhouette.subsets_at_edge(lattice, geometry.subset);
    std::vector<bool> open(static_cast<std::size_t>(lattice.count()));
    for (std::size_t point = 0; point < open.size(); ++point) {
        const PointStatus status = field.status[point];
        open[point] = !at_edge[point] && (status == PointStatus::moved_apart || status == PointStatus::low_correlation ||
                                          status == PointStatus::no_convergence);
    }
    std::vector<Vec2> torn;
    for (int start = 0; start < lattice.count(); ++start) {
        std::vector<int> patch;
        const auto take = [&](int point) {
            if (open[static_cast<std::size_t>(point)]) patch.push_back(point);
            open[static_cast<std::size_t>(point)] = false;
        };
        take(start);
        for (std::size_t next = 0; next < patch.size(); ++next) {
            const int column = patch[next] % lattice.columns, row = patch[next] / lattice.columns;
            for (int y = std::max(0, row - 1); y <= std::min(row + 1, lattice.rows - 1); ++y)
                for (int x = std::max(0, column - 1); x <= std::min(column + 1, lattice.columns - 1); ++x)
                    take(y * lattice.columns + x);
        }
        if (patch.size() < least_torn) continue;
        for (const int point : patch) torn.emplace_back(lattice.x(point), lattice.y(point));
    }
    return torn;
}

/// The motion apart of what lies to either side of a place of the line, which has its origin there; `alone` where one side has
/// nothing.
double jump_at(const std::vector<Sample>& samples, const Line& line, int subset, double alone = 0) {
    std::array<Vec2, 2> sum{Vec2::Zero(), Vec2::Zero()};
    std::array<int, 2> count{0, 0};
    const double width = clearance(subset, line.angle);
    for (const Sample& sample : samples) {
        const Vec2 local = line.local(sample.place);
        if (std::abs(local.x()) > subset || std::abs(local.y()) < width || std::abs(local.y()) > width + subset) continue;
        const std::size_t side = local.y() > 0;
        sum[side] += sample.displacement;
        ++count[side];
    }
    return count[0] > 0 && count[1] > 0 ? (sum[1] / count[1] - sum[0] / count[0]).norm() : alone;
}

/// The line as it is some way behind its tip [px].
Line behind(const Line& line, double way) { return {line.tip - way * line.direction(), line.angle}; }

/// A motion apart that tears every subset it goes through [px]. Of a jump j between two parts of a subset, a quarter to a half
/// and more of it, a warp of first order leaves a root mean square of j / 4. That must be more than `most_apart` and than what
/// noise leaves, which is about the standard error of a displacement times the root of the number of pixels. Twice as much, as
/// patterns differ from place to place.
double tearing_jump(const DisplacementField& field, int subset) {
    std::vector<double> sigma;
    for (std::size_t i = 0; i < field.status.size(); ++i)
        if (field.status[i] == PointStatus::ok) sigma.push_back(field.sigma[i]);
    const auto middle = sigma.begin() + static_cast<std::ptrdiff_t>(sigma.size() / 2);
    std::ranges::nth_element(sigma, middle);
    return 2 * 4 * std::max(most_apart, subset * *middle);
}

/// Whether a crack along the line tears most of the subsets that were torn, or strains them about its tip. They must reach up to
/// the tip, but for the `step` of their lattice, if `opens_there`: if its faces have moved apart so near to it that no subset
/// between them can be whole.
bool tears(const Line& line, const std::vector<Vec2>& torn, double width, double step, bool opens_there) {
    bool up_to_tip = !opens_there;
    const auto count = std::ranges::count_if(torn, [&](const Vec2& place) {
        const Vec2 local = line.local(place);
        up_to_tip = up_to_tip || (std::abs(local.y()) < width && local.x() > -torn_behind * width - step);
        return (local.x() < width && std::abs(local.y()) < width) || local.norm() < strained * width;
    });
    return up_to_tip && static_cast<double>(count) >= most_torn * static_cast<double>(torn.size());
}

/// The line through the torn subsets, pointing from where the sides have moved apart more. The last of them reaches over the tip
/// by up to half its width: the tip is taken in between. None where the last is the last of the lattice: then the tip is farther
/// on.
std::optional<Line> along_torn(const std::vector<Vec2>& torn, const std::vector<Sample>& samples, const FieldGeometry& geometry) {
    Vec2 middle = Vec2::Zero();
    for (const Vec2& place : torn) middle += place / static_cast<double>(torn.size());
    Eigen::Matrix2d spread = Eigen::Matrix2d::Zero();
    for (const Vec2& place : torn) spread += (place - middle) * (place - middle).transpose();
    Vec2 along = Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(spread).eigenvectors().col(1);
    double first = 0, last = 0;
    for (const Vec2& place : torn) {
        first = std::min(first, along.dot(place - middle));
        last = std::max(last, along.dot(place - middle));
    }
    const double angle = std::atan2(along.y(), along.x());
    // An end with nothing beside it, as in a notch, is the mouth.
    constexpr double everything = std::numeric_limits<double>::infinity();
    if (jump_at(samples, {middle + last * along, angle}, geometry.subset, everything) >
        jump_at(samples, {middle + first * along, angle}, geometry.subset, everything)) {
        along = -along;
        last = -first;
    }
    const PointLattice& lattice = geometry.lattice;
    const Vec2 beyond = middle + (last + lattice.step) * along - Vec2(lattice.first_x, lattice.first_y);
    const Vec2 extent = lattice.step * Vec2(lattice.columns - 1, lattice.rows - 1);
    if (beyond.minCoeff() < 0 || (extent - beyond).minCoeff() < 0) return std::nullopt;
    return Line{middle + (last - 0.25 * geometry.subset) * along, std::atan2(along.y(), along.x())};
}

/// How far the tip may be from the end of the torn subsets. Near a tip the square of the motion apart grows with the distance
/// (Williams 1957): the line that it lies on at a subset behind the end and farther back says where it begins, which is right in
/// even wood only.
double end_error(const std::vector<Sample>& samples, const Line& line, int subset) {
    const double near = jump_at(samples, behind(line, subset), subset);
    for (const int way : {3, 2, 1}) {
        const double far = jump_at(samples, behind(line, (1 + way) * subset), subset);
        if (far > near) return std::clamp(std::abs(way * near * near / (far * far - near * near) - 1), 0.25, 3.0) * subset;
    }
    return 3.0 * subset;
}

/// The best of a coarse grid of tips and directions.
Line scan(const std::vector<Sample>& all, const PointLattice& lattice, int subset) {
    std::vector<Sample> samples;
    const std::size_t every = std::max<std::size_t>(1, all.size() / scan_points);
    for (std::size_t i = every / 2; i < all.size(); i += every) samples.push_back(all[i]);
    // The score is a small difference of large sums: the mean motion says nothing and is taken off.
    Vec2 mean = Vec2::Zero();
    for (const Sample& sample : samples) mean += sample.displacement / static_cast<double>(samples.size());
    for (Sample& sample : samples) sample.displacement -= mean;

    const double across = lattice.step * (lattice.columns - 1), down = lattice.step * (lattice.rows - 1);
    const double spacing = std::max({across, down, 1.0}) / scan_places;
    Line best{{0, 0}, 0};
    double least = std::numeric_limits<double>::infinity();
    for (double y = spacing / 2; y < down; y += spacing)
        for (double x = spacing / 2; x < across; x += spacing)
            for (int turn = 0; turn < scan_angles; ++turn) {
                const Line line{{lattice.first_x + x, lattice.first_y + y}, 2 * std::numbers::pi * turn / scan_angles};
                const double width = clearance(subset, line.angle);
                if (const double score = scan_score<terms>(samples, line, width, width); score < least) {
                    least = score;
                    best = line;
                }
            }
    return best;
}

/// Turns the line to where the points beside it agree best. The series as a whole is the same for any direction, but a
/// point on the wrong side of the crack is not. Here subsets that reach over the crack take part, so that no direction
/// can hide such points in a strip; the direction is the middle of those that are about as good as the best, as no
/// point may lie between them. The best is within `range`, those about as good within `widest`.
/// Gives half the width of the range in which they are [rad].
template <int count>
double turn(const std::vector<Sample>& samples, Line& line, int subset, double range, double widest) {
    constexpr int reach = 12;  // steps
    const double step = range / reach;
    const int farthest = static_cast<int>(std::lround(widest / step));
    const auto score = [&](int i) {
        return scan_score<count>(samples, {line.tip, line.angle + i * step}, clearance(subset, line.angle), 0);
    };
    int best = -reach;
    double least = score(best);
    for (int i = 1 - reach; i <= reach; ++i)
        if (const double here = score(i); here < least) {
            least = here;
            best = i;
        }
    int first = best, last = best;  // of a short crack, between whose torn faces no point lies, beyond the range too
    while (first > -farthest && score(first - 1) <= as_good * least) --first;
    while (last < farthest && score(last + 1) <= as_good * least) ++last;
    line.angle += 0.5 * (first + last) * step;
    return 0.5 * (last - first + 1) * step;
}

/// Levenberg-Marquardt over the tip, the coefficients of the series eliminated (variable projection, Golub and Pereyra
/// 1973), derivatives by central differences. Gives the tip's covariance, were the displacements independent [px^2].
template <int count>
Eigen::Matrix2d refine(const std::vector<Sample>& samples, Line& line) {
    const auto left = [&](const Vec2& tip) -> Eigen::VectorXd { return residuals<count>(samples, {tip, line.angle}).reshaped(); };
    Eigen::VectorXd now = left(line.tip);
    double damping = 1e-3;
    Eigen::Matrix2d normal;
    for (int iteration = 0; iteration < most_iterations; ++iteration) {
        Eigen::MatrixX2d jacobian(now.size(), 2);
        for (int i = 0; i < 2; ++i) {
            const Vec2 step = difference_step * Vec2::Unit(i);
            jacobian.col(i) = (left(line.tip + step) - left(line.tip - step)) / (2 * difference_step);
        }
        normal = jacobian.transpose() * jacobian;
        Eigen::Matrix2d damped = normal;
        damped.diagonal() *= 1 + damping;
        const Vec2 step = -damped.ldlt().solve(jacobian.transpose() * now);
        if (!step.allFinite() || step.norm() < settled || damping > most_damping) break;
        const Vec2 tip = line.tip + step * std::min(1.0, longest_step / step.norm());
        const Eigen::VectorXd then = left(tip);
        if (then.squaredNorm() < now.squaredNorm()) {
            line.tip = tip;
            now = then;
            damping *= 0.2;
        } else {
            damping *= 8;
        }
    }
    return now.squaredNorm() / static_cast<double>(now.size() - 2 * count - 2) * normal.inverse();
}

struct Fitted {
    Line line;
    Eigen::Matrix2d covariance;  // of the tip, were the displacements independent [px^2]
    double turned = 0;           // half width of the directions that are as good [rad]
};

/// The points that take part depend on the line, and the line on them: some rounds, of points within a radius [px] and of
/// directions within a range [degrees]. Absent where too few points are left.
template <int count>
std::optional<Fitted> fit_in_rounds(const std::vector<Sample>& samples, const Line& from, int subset,
                                    std::initializer_list<std::pair<double, double>> rounds) {
    constexpr double degree = std::numbers::pi / 180;
    Fitted fitted{from, Eigen::Matrix2d::Zero()};
    for (const auto& [radius, range] : rounds) {
        const double widest = std::isfinite(radius) ? widest_turn : range * degree;
        fitted.turned = turn<count>(within(samples, fitted.line.tip, radius), fitted.line, subset, range * degree, widest);
        const std::vector<Sample> clear = clear_of(within(samples, fitted.line.tip, radius), fitted.line, subset);
        if (static_cast<int>(clear.size()) < least_points<count>) return std::nullopt;
        fitted.covariance = refine<count>(clear, fitted.line);
    }
    return fitted;
}

/// How much better the series is than a polynomial: F statistic of what its jump and singularity take off.
double gain(const std::vector<Sample>& samples, const Line& line) {
    Eigen::Matrix<double, Eigen::Dynamic, smooth_terms> rows(samples.size(), smooth_terms);
    Displacements right(samples.size(), 2);
    for (Eigen::Index i = 0; i < rows.rows(); ++i) {
        const Sample& sample = samples[static_cast<std::size_t>(i)];
        const Vec2 p = line.local(sample.place) / unit;
        const double x = p.x(), y = p.y();
        rows.row(i) << 1, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y;
        right.row(i) = sample.displacement.transpose();
    }
    const double smooth = (right - rows * rows.householderQr().solve(right)).squaredNorm();
    const double cracked = residuals<terms>(samples, line).squaredNorm();
    const double freedom = 2.0 * static_cast<double>(rows.rows() - terms);
    return (smooth - cracked) / (2 * (terms - smooth_terms)) / (cracked / freedom);
}

/// Whether the terms from n = 5 on take off more than noise gives them, of which so many neighbours share the same.
bool has_more(const std::vector<Sample>& samples, const Line& line, double overlap) {
    constexpr double least = 3;  // times what noise gives on the average
    const double without = residuals<terms>(samples, line).squaredNorm(),
                 with = residuals<more_terms>(samples, line).squaredNorm();
    const double freedom = 2.0 * static_cast<double>(samples.size()) - 2 * more_terms;
    return freedom > 0 && (without - with) / (2 * (more_terms - terms)) > least * overlap * with / freedom;
}

/// Share of what the series leaves that is no noise: near 0 where the series holds, near 1 in wood that it does not describe.
template <int count>
double misfit(const std::vector<Sample>& samples, const Line& line) {
    const double freedom = 2.0 * static_cast<double>(samples.size()) - 2 * count - 2;
    const double left = residuals<count>(samples, line).squaredNorm() / freedom;
    double noise = 0;
    for (const Sample& sample : samples) noise += sample.sigma * sample.sigma / static_cast<double>(samples.size());
    return left > noise ? 1 - noise / left : 0;
}

/// By how much the tip moves with a ring of that radius [px]; a ring's radius at most, and not at all where it has too few
/// points.
template <int count>
Vec2 move_with(const std::vector<Sample>& samples, const Line& line, int subset, double radius) {
    const std::vector<Sample> clear = clear_of(within(samples, line.tip, radius), line, subset);
    if (static_cast<int>(clear.size()) < least_points<count>) return Vec2::Zero();
    Line again = line;
    refine<count>(clear, again);
    const Vec2 move = again.tip - line.tip;
    return move.allFinite() ? Vec2(move * std::min(1.0, radius / move.norm())) : Vec2(radius * line.direction());
}

/// What the series misses is no noise: neighbours share it over lengths that are the wood's, and it leads the tip astray. Nothing
/// in the wood asks for this ring and this number of terms: by how much the tip moves with each other choice is what it may be
/// off by. In a smaller ring the series holds better, and that move counts in full; in a larger one or with the other number of
/// terms it holds less well even in even wood, and these count by the share of what is left that is no noise.
template <int count, int other>
std::array<Vec2, 3> model_errors(const std::vector<Sample>& samples, const Line& line, int subset) {
    const double ring = ring_subsets * subset;
    const double share = std::sqrt(misfit<count>(clear_of(within(samples, line.tip, ring), line, subset), line));
    return {move_with<count>(samples, line, subset, ring / other_ring),
            share * move_with<count>(samples, line, subset, ring * other_ring),
            share * move_with<other>(samples, line, subset, ring)};
}

/// Standard deviation of the tip's place along its line by how likely each place on it is, the line held: where a crack is hardly
/// open, places far from the best one explain the field about as well, and the curvature there does not know [px].
template <int count>
double spread_along(const std::vector<Sample>& samples, const Line& line, int subset, double overlap) {
    const double ring = ring_subsets * subset, step = 0.25 * subset;
    const auto at = [&](double way) { return Line{line.tip + way * line.direction(), line.angle}; };
    // The same points for all places: those clear of the longest crack.
    const std::vector<Sample> clear = clear_of(within(samples, line.tip, ring), at(ring), subset);
    const double freedom = 2.0 * static_cast<double>(clear.size()) - 2 * count - 2;
    if (static_cast<int>(clear.size()) < least_points<count>) return 0.0;
    std::vector<std::pair<double, double>> places;  // way, misfit
    double least = std::numeric_limits<double>::infinity();
    for (double way = -ring; way <= ring; way += step) {
        places.emplace_back(way, residuals<count>(clear, at(way)).squaredNorm());
        least = std::min(least, places.back().second);
    }
    double weights = 0, squares = 0;
    for (const auto& [way, left] : places) {
        const double weight = std::exp(-0.5 * (left / least - 1) * freedom / overlap);
        weights += weight;
        squares += weight * way * way;
    }
    return std::sqrt(squares / weights);
}

std::vector<Sample> followed(const PointLattice& lattice, const DisplacementField& field) {
    std::vector<Sample> samples;
    for (int point = 0; point < lattice.count(); ++point)
        if (const auto i = static_cast<std::size_t>(point); field.status[i] == PointStatus::ok)
            samples.push_back({Vec2(lattice.x(point), lattice.y(point)), Vec2(field.u[i], field.v[i]), field.sigma[i]});
    return samples;
}

}  // namespace

std::optional<double> motion_apart(const FieldGeometry& geometry, const DisplacementField& field, const CrackTip& crack) {
    const std::vector<Sample> samples = followed(geometry.lattice, field);
    const Line line{crack.tip, crack.angle};
    double most = 0;
    for (double way = geometry.subset; way < crack.length; way += geometry.subset)
        most = std::max(most, jump_at(samples, behind(line, way), geometry.subset));
    return most > 0 ? std::optional(most) : std::nullopt;
}

CrackTip find_crack_tip(const FieldGeometry& geometry, const DisplacementField& field) {
    const PointLattice& lattice = geometry.lattice;
    const std::vector<Sample> samples = followed(lattice, field);
    CrackTip found;
    found.status = TipStatus::too_few_points;
    if (static_cast<int>(samples.size()) < 2 * least_points<terms>) return found;

    constexpr double everywhere = std::numeric_limits<double>::infinity();
    const double ring = ring_subsets * geometry.subset;
    const Line first = scan(samples, lattice, geometry.subset);
    auto fitted =
        fit_in_rounds<terms>(samples, first, geometry.subset, {{everywhere, 12}, {everywhere, 6}, {ring, 3}, {ring, 2}});
    if (!fitted) return found;
    // Neighbouring subsets see the same pixels: as many points are independent as subsets lie side by side.
    const double overlap = std::max(1.0, std::pow(static_cast<double>(geometry.subset) / lattice.step, 2));
    // Where the specimen's sides are near, the field goes on beyond what the terms up to n = 4 can say.
    bool goes_on = false;
    if (has_more(clear_of(within(samples, fitted->line.tip, ring), fitted->line, geometry.subset), fitted->line, overlap)) {
        const auto more = fit_in_rounds<more_terms>(samples, fitted->line, geometry.subset, {{ring, 3}, {ring, 2}});
        goes_on = more.has_value();
        if (goes_on) fitted = more;
    }
    Line line = fitted->line;
    // Torn subsets without a motion apart are shadows, dust and the like.
    if (!(gain(clear_of(samples, line, geometry.subset), line) > least_gain)) {
        found.status = TipStatus::no_crack;
        return found;
    }
    // In wood whose rings differ much in stiffness the series may fit better elsewhere than at the crack.
    const std::vector<Vec2> torn = torn_places(geometry, field);
    const double width = clearance(geometry.subset, line.angle);
    const bool opens =
        jump_at(samples, behind(line, torn_behind * width), geometry.subset) > tearing_jump(field, geometry.subset);
    const bool missed = torn.size() >= least_torn && !tears(line, torn, width, lattice.step, opens);
    if (missed) {
        const std::optional<Line> torn_line = along_torn(torn, samples, geometry);
        if (!torn_line) {
            found.status = TipStatus::outside;
            return found;
        }
        line = *torn_line;
    }
    const bool inside =
        line.tip.x() >= 0 && line.tip.x() <= geometry.columns - 1 && line.tip.y() >= 0 && line.tip.y() <= geometry.rows - 1;
    const std::vector<Sample> clear = clear_of(samples, line, geometry.subset);
    if (static_cast<int>(clear.size()) < least_points<terms>) return found;
    if (!(gain(clear, line) > least_gain)) {
        found.status = TipStatus::no_crack;
        return found;
    }
    if (!inside) {
        found.status = TipStatus::outside;
        return found;
    }
    found.status = TipStatus::ok;
    found.tip = line.tip;
    found.angle = std::remainder(line.angle, 2 * std::numbers::pi);
    const auto length = [&](const Vec2& moved, double turned) {
        const Line other{line.tip + moved, line.angle + turned};
        return geometry.silhouette.to_mouth(other.tip, -other.direction());
    };
    found.length = length(Vec2::Zero(), 0);
    if (missed) {
        found.tip_sigma = found.sigma = end_error(samples, line, geometry.subset);
        return found;
    }
    const Vec2 by_tip(0.5 * (length({1, 0}, 0) - length({-1, 0}, 0)), 0.5 * (length({0, 1}, 0) - length({0, -1}, 0)));
    const std::array<Vec2, 3> moves = goes_on ? model_errors<more_terms, terms>(samples, line, geometry.subset)
                                              : model_errors<terms, more_terms>(samples, line, geometry.subset);
    // On either side the nearest whole subsets, which are a step of the lattice apart, end the directions that are as good.
    const double turned =
        std::min(fitted->turned / std::sqrt(3.0), lattice.step / (std::sqrt(24.0) * std::min(ring, found.length)));
    const double turn_error = 0.5 * (length(Vec2::Zero(), turned) - length(Vec2::Zero(), -turned));
    const auto error = [&](const Vec2& by) {
        double square = overlap * by.dot(fitted->covariance * by);
        for (const Vec2& move : moves) square += by.dot(move) * by.dot(move);
        return std::sqrt(square);
    };
    const double spread = goes_on ? spread_along<more_terms>(samples, line, geometry.subset, overlap)
                                  : spread_along<terms>(samples, line, geometry.subset, overlap);
    found.tip_sigma = std::max(error(line.direction()), spread);
    found.sigma = std::max(std::hypot(error(by_tip), turn_error), spread);
    return found;
}

}  // namespace crampfit
