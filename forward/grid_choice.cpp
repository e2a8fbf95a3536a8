#include "forward/grid_choice.hpp"

#include "datasets/error.hpp"
#include "forward/plan.hpp"
#include "forward/simulate.hpp"
#include "forward/thin_voids.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <limits>
#include <optional>

namespace crampfit {

namespace {

constexpr double cells_of_coarsest = 16;  // across the smaller side
constexpr double most_cells_tried = 128;

// Advances that a cell of the coarsest grid may span, as far as three grids have room for it. One of the chosen grid spans no
// more than one: over less the load goes in steps with the grid.
constexpr double most_advances_a_cell = 2.0;

constexpr double most_cells_chosen = 512;
constexpr int multiple = 4;  // of cells: places on lines of the grids tried lie on lines of the chosen one

// An error below this one asks for so many cells across bands of stiff wood, where no more than that across the smaller side do.
constexpr double least_for_bands = 0.02;
constexpr double cells_in_band = 2.0, most_cells_for_bands = 256;

constexpr double safety = 1.25;  // Roache's, for three grids
constexpr double least_power = 0.5;
constexpr double most_power = 2.0;

// A crack that kinks by more than this (cosine) turns across the lines of the grid: what it releases then is off by a part that
// comes and goes with the tip's place in a cell, so that two grids may agree by chance. It goes with the first power at best.
constexpr double kinked = 0.985;
constexpr double most_power_at_kinks = 1.0;
constexpr double finer_at_kinks = 1.25;  // cells, where a run on the chosen grid shows it to be off by more than was asked

// Time as a power of the cells to a side, as the two finest grids tried show it: between what little grids cost anyway, and cells
// times stations or factorisation.
constexpr double least_power_of_time = 1.0;
constexpr double most_power_of_time = 3.0;

struct Quantity {
    std::string name;
    double value;
};

struct Trial {
    double cells;  // across the smaller side
    std::vector<Quantity> quantities;
    double seconds;
    bool kinks;  // a crack, as it grows
};

Scene with_cells(Scene scene, double cells) {
    scene.model.cell = scene.specimen.size.minCoeff() / cells;
    return scene;
}

std::vector<Quantity> quantities_of(const Record& record) {
    std::vector<Quantity> found;
    if (record.series.empty()) return found;
    const double start = record.series.front().crack_length;
    const Instant* loaded = nullptr;
    double largest = 0.0;
    for (const Instant& row : record.series) {
        if (row.crack_length <= start * (1.0 + 1e-9) && row.displacement != 0.0) loaded = &row;
        largest = std::max(largest, row.force);
    }
    if (loaded && loaded->force != 0.0)
        found.push_back({"force over displacement before growth", loaded->force / loaded->displacement});
    if (record.driving.empty() || record.series.back().crack_length <= start) {  // where the crack would grow is not of this run
        if (record.series.back().G > 0.0) found.push_back({"energy release rate", record.series.back().G});
    } else {
        found.push_back({"displacement at first growth", record.driving.front().displacement});
        if (largest > 0.0) found.push_back({"largest force", largest});
    }
    return found;
}

bool kinks(const Scene& scene, const Record& record) {
    for (std::size_t k = 0; k < scene.cracks.size(); ++k) {
        const std::vector<Vec2>&before = scene.cracks[k].points, &path = record.paths[k];
        const auto turns = [](const Vec2& from, const Vec2& tip, const Vec2& to) {
            return to != tip && (tip - from).normalized().dot((to - tip).normalized()) < kinked;
        };
        const auto old = std::ranges::search(path, before);  // within it
        if (old.empty()) continue;
        if (old.begin() != path.begin() && turns(before[1], before[0], *std::prev(old.begin()))) return true;
        if (old.end() != path.end() && turns(before[before.size() - 2], before.back(), *old.end())) return true;
    }
    return false;
}

// Not where the grid is too coarse for anything.
bool bridges_voids(const Scene& scene, double cells) {
    const Scene other = with_cells(scene, cells);
    try {
        const MaterialMap materials(other);
        return thin_voids(other, Discretisation(other, materials)).has_value();
    } catch (const InputError&) {
        return false;
    }
}

// Nothing where the grid is too coarse for the scene: an edge or a body then finds no node, or no equilibrium is found.
std::optional<Trial> try_grid(const Scene& scene, double cells, bool extrapolate = false) {
    Scene coarse = with_cells(scene, cells);
    coarse.output.frames = 0;
    coarse.output.samples = 50;
    coarse.solver.extrapolate = extrapolate;  // or the change from grid to grid would not tell the error
    try {
        const Record record = simulate(coarse);
        Trial trial{cells, quantities_of(record), record.seconds, kinks(coarse, record)};
        const bool good = std::all_of(trial.quantities.begin(), trial.quantities.end(),
                                      [](const Quantity& q) { return std::isfinite(q.value); });
        if (record.status == RunStatus::unstable || trial.quantities.empty() || !good) return {};
        return trial;
    } catch (const InputError&) {
        return {};
    }
}

// Error of a quantity as a power of the cell.
struct Estimate {
    std::string name;
    double at_finest;
    double power;
    double cells;
    std::array<std::pair<double, double>, 2> seen;  // coarser grids' cells, and how far off these were

    // Whatever the power says, fewer cells than those of a grid that was seen are no better, and between two of these the error
    // goes from one to the other.
    double at(double other_cells) const {
        double error = at_finest * std::pow(cells / other_cells, power);
        std::pair<double, double> finer{cells, at_finest};
        for (auto one = seen.rbegin(); one != seen.rend(); finer = *one++) {
            if (other_cells <= one->first) error = std::max(error, one->second);
            else if (other_cells < finer.first && finer.second > 0.0) {
                const double way = std::log(other_cells / one->first) / std::log(finer.first / one->first);
                error = std::max(error, one->second * std::pow(finer.second / one->second, way));
            }
        }
        return error;
    }
};

// Of what all three grids know.
std::vector<Estimate> estimates_of(const Trial& coarse, const Trial& middle, const Trial& fine) {
    std::vector<Estimate> found;
    for (const Quantity& q : fine.quantities) {
        const auto in = [&](const Trial& trial) {
            return std::find_if(trial.quantities.begin(), trial.quantities.end(),
                                [&](const Quantity& o) { return o.name == q.name; });
        };
        const auto a = in(coarse), b = in(middle);
        if (a == coarse.quantities.end() || b == middle.quantities.end() || q.value == 0.0) continue;
        const double first = std::abs((a->value - b->value) / q.value), second = std::abs((b->value - q.value) / q.value);
        const bool at_kinks = coarse.kinks || middle.kinks || fine.kinks;
        const double highest = at_kinks ? most_power_at_kinks : most_power;
        const double power = second == 0.0 ? highest : std::clamp(std::log2(first / second), least_power, highest);
        const double seen = at_kinks ? std::max(second, std::pow(0.5, most_power_at_kinks) * first) : second;
        const double at_finest = safety * seen / (std::pow(2.0, power) - 1.0);
        const double coarse_off = std::abs(a->value / q.value - 1.0) + at_finest, middle_off = second + at_finest;
        found.push_back({q.name, at_finest, power, fine.cells, {{{coarse.cells, coarse_off}, {middle.cells, middle_off}}}});
    }
    return found;
}

const Estimate& worst_of(const std::vector<Estimate>& estimates, double cells) {
    return *std::max_element(estimates.begin(), estimates.end(),
                             [&](const Estimate& a, const Estimate& b) { return a.at(cells) < b.at(cells); });
}

// The fewest cells, a multiple, that are no wider than so many of the advances over which cracks balance energy.
double least_cells(const Scene& scene, double advances_a_cell) {
    double cells = cells_of_coarsest;
    for (const Crack& crack : scene.cracks)
        if (crack.grows != Growth::none && crack.advance > 0.0)
            cells = std::max(cells, scene.specimen.size.minCoeff() / (advances_a_cell * crack.advance));
    return multiple * std::ceil(cells / multiple - 1e-9);
}

// How far off a run as it will be is from the finest grid tried, with what that one may be off itself.
std::optional<Quantity> seen_off(const Scene& scene, double cells, const Trial& fine, const std::vector<Estimate>& estimates) {
    const auto trial = try_grid(scene, cells, scene.solver.extrapolate);
    if (!trial) return {};
    Quantity worst{"", 0.0};
    for (const Estimate& estimate : estimates) {
        const auto same = [&](const Quantity& q) { return q.name == estimate.name; };
        const auto here = std::ranges::find_if(trial->quantities, same), there = std::ranges::find_if(fine.quantities, same);
        if (here == trial->quantities.end()) return {};
        const double off = std::abs(here->value / there->value - 1.0) + estimate.at_finest;
        if (off > worst.value) worst = {estimate.name, off};
    }
    return worst;
}

// The fewest cells that meet the error, from `least` on; more than `most_cells_chosen` where none do.
double fewest_cells(const std::vector<Estimate>& estimates, double asked, double least) {
    double cells = least;
    while (cells <= most_cells_chosen && worst_of(estimates, cells).at(cells) > asked) cells += multiple;
    return cells;
}

// How wide bands of wood that is much stiffer than other are: most of it lies in such or wider ones; none where there is no such
// wood [m].
std::optional<double> width_of_bands(const Scene& scene) {
    constexpr int samples = 512;  // across the smaller side
    constexpr double most = 0.7, much_stiffer = 4.0, stiff = 0.5;
    const MaterialMap materials(scene);
    if (materials.homogeneous()) return {};
    const double pitch = scene.specimen.size.minCoeff() / samples;
    const int columns = static_cast<int>(scene.specimen.size.x() / pitch),
              rows = static_cast<int>(scene.specimen.size.y() / pitch);
    std::vector<double> stiffness(static_cast<std::size_t>(columns) * rows);
    for (int j = 0; j < rows; ++j)
        for (int i = 0; i < columns; ++i) {
            const Eigen::Matrix3d wood = materials.at(pitch * Vec2(i + 0.5, j + 0.5)).elasticity.stiffness();
            stiffness[static_cast<std::size_t>(j) * columns + i] = std::max(wood(0, 0), wood(1, 1));
        }
    const double stiffest = std::ranges::max(stiffness);
    if (std::ranges::none_of(stiffness, [&](double one) { return one > 0.0 && one * much_stiffer < stiffest; })) return {};
    // Along a row or column, by the stretch that it is in.
    std::vector<int> width(stiffness.size(), std::numeric_limits<int>::max());
    const auto note = [&](int count, const auto& place) {
        for (int k = 0, from = 0; k <= count; ++k) {
            if (k < count && stiffness[place(k)] >= stiff * stiffest) continue;
            for (int l = from; l < k; ++l) width[place(l)] = std::min(width[place(l)], k - from);
            from = k + 1;
        }
    };
    for (int j = 0; j < rows; ++j) note(columns, [&](int i) { return static_cast<std::size_t>(j) * columns + i; });
    for (int i = 0; i < columns; ++i) note(rows, [&](int j) { return static_cast<std::size_t>(j) * columns + i; });
    std::erase(width, std::numeric_limits<int>::max());
    const auto narrow = width.begin() + static_cast<std::ptrdiff_t>((1.0 - most) * static_cast<double>(width.size()));
    std::ranges::nth_element(width, narrow);
    return *narrow * pitch;
}

// Errors of bands of less than two cells come and go with where they lie in these: two grids that agree tell little.
double cells_for_bands(const Scene& scene, double cells) {
    const auto width = width_of_bands(scene);
    if (!width) return cells;
    const double needed = multiple * std::ceil(cells_in_band * scene.specimen.size.minCoeff() / *width / multiple - 1e-9);
    return needed > most_cells_for_bands ? cells : std::max(cells, needed);
}

[[noreturn]] void refuse(const Scene& scene, double error, const std::string& rule) {
    throw InputError(scene.file.string(), "model.error", fmt::format("{:g} %", 100 * error), rule);
}

Plan plan_of(const Scene& scene) {
    const MaterialMap materials(scene);
    return make_plan(scene, materials, Discretisation(scene, materials));
}

double seconds_on(const Scene& scene, double cells, const Trial& middle, const Trial& fine) {
    const double power = std::clamp(std::log2(fine.seconds / middle.seconds), least_power_of_time, most_power_of_time);
    const double own = fine.seconds * std::pow(cells / fine.cells, power);
    return plan_of(with_cells(scene, cells)).extrapolates ? own * (1.0 + std::pow(0.5, power)) : own;
}

void require_equilibrium(const Scene& scene, double error) {
    if (!plan_of(with_cells(scene, 2 * cells_of_coarsest)).quasistatic)
        refuse(scene, error,
               "the cell is chosen at equilibrium only; explicit dynamics has errors of time and inertia too: give model.cell");
}

}  // namespace

GridChoice choose_grid(const Scene& scene, double error) {
    require_equilibrium(scene, error);
    const auto start = std::chrono::steady_clock::now();
    std::vector<Trial> trials;
    std::vector<Estimate> estimates;
    double chosen = most_cells_chosen + multiple;
    const double coarsest = std::min(least_cells(scene, most_advances_a_cell), most_cells_tried / 2.0);
    const double least = least_cells(scene, 1.0);
    double most = most_cells_tried;
    for (double cells = coarsest; cells <= most; cells *= 2.0) {
        if (bridges_voids(scene, cells)) {
            most = 2.0 * most_cells_tried;  // finer ones than else have a say
            trials.clear();
            continue;
        }
        const auto trial = try_grid(scene, cells);
        if (!trial) {
            trials.clear();
            continue;
        }
        trials.push_back(*trial);
        const std::size_t n = trials.size();
        if (n < 3) continue;
        estimates = estimates_of(trials[n - 3], trials[n - 2], trials[n - 1]);
        if (estimates.empty()) continue;
        chosen = std::max(fewest_cells(estimates, error, least), trials.front().cells);
        if (chosen <= 2.0 * cells) break;  // else so far beyond the grids tried that one more is worth it
    }
    if (estimates.empty() && most > most_cells_tried)
        refuse(
            scene, error,
            fmt::format("grids with fewer than {:g} cells across join the wood on both sides of voids that are thinner than two "
                        "of them, and three that do not are needed: draw cracks along the voids, or give model.cell",
                        trials.empty() ? most : trials.front().cells));
    if (estimates.empty())
        refuse(scene, error,
               fmt::format("not three of the grids with {:g} to {:g} cells across gave a result to compare: give model.cell",
                           coarsest, most_cells_tried));
    if (chosen > most_cells_chosen)
        refuse(scene, error,
               fmt::format(
                   "{:g} cells across would not meet it ({:.2g} % of {}): ask for less, or give model.cell{}", most_cells_chosen,
                   100 * worst_of(estimates, most_cells_chosen).at(most_cells_chosen),
                   worst_of(estimates, most_cells_chosen).name,
                   std::ranges::any_of(scene.cracks, [](const Crack& c) { return c.grows != Growth::none && c.advance == 0.0; })
                       ? ", or an advance to a crack that grows through rings without one"
                       : ""));
    if (error < least_for_bands) chosen = cells_for_bands(scene, chosen);
    const Trial& finest = trials.back();
    std::optional<Quantity> off;
    while (finest.kinks && chosen < finest.cells && (off = seen_off(scene, chosen, finest, estimates)) && off->value > error) {
        chosen = multiple * std::ceil(finer_at_kinks * chosen / multiple);
        off.reset();
    }
    const Estimate& worst = worst_of(estimates, chosen);
    GridChoice choice;
    choice.cell = scene.specimen.size.minCoeff() / chosen;
    choice.error = worst.at(chosen);
    choice.quantity = worst.name;
    if (off && off->value > choice.error) choice.error = off->value, choice.quantity = off->name;
    choice.seconds = seconds_on(scene, chosen, trials[trials.size() - 2], finest);
    choice.seconds_spent = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    choice.text = fmt::format(
        "{:<15} {:.2g} % estimated, of {}; {:g} % asked for\n{:<15}   because: {:g} cells across change it by little enough "
        "from grid to grid, going with the power {:.2g} of the cell{}\n{:<15} about {:.2g} s for the whole run\n",
        "error", 100 * choice.error, choice.quantity, 100 * error, "", chosen, worst.power,
        off ? fmt::format("; a crack kinks, and a run on them is compared with one on {:g}", finest.cells) : "", "",
        choice.seconds);
    return choice;
}

}  // namespace crampfit
