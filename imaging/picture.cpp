#include "imaging/picture.hpp"

#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "imaging/gray_picture.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>

namespace crampfit {
namespace {

/// What one gray value stands for.
struct Meaning {
    std::uint8_t label;
    float grade;
};
using Meanings = std::array<std::optional<Meaning>, 256>;

std::string text(const GrayClass& range) {
    return range.material + " [" + std::to_string(range.low) + ", " + std::to_string(range.high) + "]";
}

/// From bright to dark, so that neighbours grade into each other.
std::vector<GrayClass> sorted_classes(const Picture& picture, const std::string& asking_file) {
    const auto fail = [&](const std::string& value, const char* rule) {
        throw InputError(asking_file, "specimen.classes", value, rule);
    };
    std::vector<GrayClass> classes = picture.classes;
    if (classes.empty() || classes.size() >= Specimen::void_label) {
        fail(std::to_string(classes.size()) + " classes", "must be from 1 to 254 classes");
    }
    std::sort(classes.begin(), classes.end(), [](const GrayClass& a, const GrayClass& b) { return a.low > b.low; });
    for (std::size_t i = 0; i < classes.size(); ++i) {
        if (classes[i].low < 0 || classes[i].high > 255 || classes[i].low > classes[i].high) {
            fail(text(classes[i]), "a gray range must be [low, high] with 0 <= low <= high <= 255");
        }
        if (i > 0 && classes[i].high >= classes[i - 1].low) {
            fail(text(classes[i - 1]) + ", " + text(classes[i]), "gray ranges must not overlap");
        }
    }
    return classes;
}

Meanings meanings_of_grays(const std::vector<GrayClass>& classes, bool graded) {
    Meanings meanings;
    for (std::size_t i = 0; i < classes.size(); ++i) {
        const auto label = static_cast<std::uint8_t>(i);
        for (int gray = classes[i].low; gray <= classes[i].high; ++gray) {
            meanings[gray] = Meaning{label, 0.0f};
        }
        if (graded && i + 1 < classes.size()) {
            const int bright = classes[i].low, dark = classes[i + 1].high;
            for (int gray = dark + 1; gray < bright; ++gray) {
                meanings[gray] = Meaning{label, static_cast<float>(bright - gray) / static_cast<float>(bright - dark)};
            }
        }
    }
    return meanings;
}

/// Throws unless every gray that occurs has a meaning; names the commonest one that has none.
void require_covered(const GrayPicture& pixels, const Meanings& meanings, const Picture& picture,
                     const std::vector<GrayClass>& classes, const std::string& asking_file) {
    std::array<long, 256> count{};
    for (const std::uint8_t gray : pixels.gray) {
        ++count[gray];
    }
    int grays = 0, commonest = 0;
    long all = 0;
    for (int gray = 0; gray < 256; ++gray) {
        if (count[gray] > 0 && !meanings[gray]) {
            commonest = grays == 0 || count[gray] > count[commonest] ? gray : commonest;
            ++grays;
            all += count[gray];
        }
    }
    if (grays == 0) {
        return;
    }
    std::string ranges = text(classes.front());
    for (std::size_t i = 1; i < classes.size(); ++i) {
        ranges += ", " + text(classes[i]);
    }
    std::string rule = "must cover every gray of " + picture.file.string() + ", but gray " + std::to_string(commonest) + " (" +
                       std::to_string(count[commonest]) + " pixels) lies in no range";
    if (grays > 1) {
        rule += ", nor do " + std::to_string(grays - 1) + " other grays; " + std::to_string(all) + " pixels in all";
    }
    throw InputError(asking_file, "specimen.classes", ranges, rule);
}

std::vector<float> read_orientation(const Picture& picture, const GrayPicture& pixels, const std::string& asking_file) {
    const PictureKey key{asking_file, "specimen.orientation"};
    const GrayPicture angles = read_gray(picture.orientation, key);
    if (angles.columns != pixels.columns || angles.rows != pixels.rows) {
        const auto size = [](const GrayPicture& p) { return std::to_string(p.columns) + " x " + std::to_string(p.rows); };
        throw InputError(key.file, key.key, picture.orientation.string(),
                         "must be as large as the picture: it is " + size(angles) + " pixels, the picture " + size(pixels));
    }
    std::vector<float> orientation(angles.gray.size());
    std::transform(angles.gray.begin(), angles.gray.end(), orientation.begin(),
                   [](std::uint8_t gray) { return static_cast<float>(gray * std::numbers::pi / 255); });
    return orientation;
}

/// `asking_file` is what errors name as the place of the keys.
Specimen read_picture(const Picture& picture, const std::string& asking_file) {
    if (!(std::isfinite(picture.pixel) && picture.pixel > 0)) {
        throw InputError(asking_file, "specimen.pixel", std::to_string(picture.pixel) + " m", "must be a positive length");
    }
    const std::vector<GrayClass> classes = sorted_classes(picture, asking_file);
    const GrayPicture pixels = read_gray(picture.file, {asking_file, "specimen.image"});
    const Meanings meanings = meanings_of_grays(classes, picture.graded);
    require_covered(pixels, meanings, picture, classes, asking_file);

    Specimen specimen;
    specimen.columns = pixels.columns;
    specimen.rows = pixels.rows;
    specimen.pixel = picture.pixel;
    specimen.source = picture.file.string();
    for (const GrayClass& range : classes) {
        specimen.classes.push_back(range.material);
    }
    specimen.label.reserve(pixels.gray.size());
    specimen.grade.reserve(picture.graded ? pixels.gray.size() : 0);
    for (const std::uint8_t gray : pixels.gray) {
        specimen.label.push_back(meanings[gray]->label);
        if (picture.graded) {
            specimen.grade.push_back(meanings[gray]->grade);
        }
    }
    if (!picture.orientation.empty()) {
        specimen.orientation = read_orientation(picture, pixels, asking_file);
    }
    return specimen;
}

/// Transition wood without a material of its own is half way from EW to LW in density.
void grade_transition(const Scene& scene, Specimen& specimen) {
    const std::vector<std::string> three{"EW", "transition", "LW"};
    if (specimen.classes != three || scene.materials.contains("transition")) {
        return;
    }
    specimen.classes = {"EW", "LW"};
    specimen.grade.assign(specimen.label.size(), 0.0f);
    for (std::size_t i = 0; i < specimen.label.size(); ++i) {
        if (specimen.label[i] == 1) {
            specimen.label[i] = 0;
            specimen.grade[i] = 0.5f;
        } else if (specimen.label[i] == 2) {
            specimen.label[i] = 1;
        }
    }
}

/// Wood whose density the specimen knows lies between EW and LW by it, and its constants follow by the exponents of density.
void grade_by_density(const Scene& scene, Specimen& specimen) {
    if (specimen.density.empty()) {
        return;
    }
    const auto early = scene.materials.find("EW"), late = scene.materials.find("LW");
    if (early == scene.materials.end() || late == scene.materials.end() || !(late->second.density > early->second.density)) {
        throw InputError(scene.file.string(), "specimen.file", scene.specimen.file.string(),
                         "has a map of density: the materials EW and LW are needed, LW the denser");
    }
    specimen.classes = {"EW", "LW"};
    specimen.grade.assign(specimen.label.size(), 0.0f);
    for (std::size_t i = 0; i < specimen.label.size(); ++i) {
        if (specimen.label[i] != Specimen::void_label) {
            const double grade = (specimen.density[i] - early->second.density) / (late->second.density - early->second.density);
            specimen.label[i] = grade >= 1.0 ? 1 : 0;
            specimen.grade[i] = grade >= 1.0 ? 0.0f : static_cast<float>(std::max(grade, 0.0));
        }
    }
}

void require_materials(const Scene& scene, const Specimen& specimen, const std::string& key) {
    for (const std::string& name : specimen.classes) {
        if (!scene.materials.contains(name)) {
            throw InputError(scene.file.string(), key, name, "must be one of the scene's materials");
        }
    }
}

}  // namespace

Specimen read_picture(const Picture& picture) { return read_picture(picture, picture.file.string()); }

void load_specimen(Scene& scene) {
    SpecimenPlan& plan = scene.specimen;
    if (plan.picture) {
        Specimen specimen = read_picture(*plan.picture, scene.file.string());
        require_materials(scene, specimen, "specimen.classes");
        plan.map = std::make_shared<const Specimen>(std::move(specimen));
    } else if (!plan.file.empty()) {
        const auto fail = [&](const std::string& rule) {
            throw InputError(scene.file.string(), "specimen.file", plan.file.string(), rule);
        };
        Specimen specimen;
        try {
            specimen = read_specimen(plan.file);
        } catch (const InputError& error) {
            fail(error.key.empty() ? error.rule : fmt::format("{} = {}: {}", error.key, error.value, error.rule));
        }
        if (!(specimen.pixel > 0)) {
            fail("has no scale: segment its picture again with --pixel");
        }
        grade_by_density(scene, specimen);
        grade_transition(scene, specimen);
        require_materials(scene, specimen, "specimen.file");
        plan.map = std::make_shared<const Specimen>(std::move(specimen));
    }
}

}  // namespace crampfit
