#include "datasets/error.hpp"
#include "datasets/keys.hpp"
#include "datasets/limits.hpp"
#include "datasets/scene_geometry.hpp"
#include "datasets/scene_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace crampfit {
namespace {

using Materials = std::map<std::string, Material>;

void check_material(const Entry& entry, const std::string& name, const Materials& materials) {
    if (!materials.contains(name)) {
        std::vector<std::string> names;
        for (const auto& [known, material] : materials) {
            names.push_back(known);
        }
        entry.fail(fmt::format("there is no [materials.{}]{}", name, suggestion(name, names)));
    }
}

Polygon read_polygon(const Entry& entry) {
    Polygon polygon;
    for (const Entry& point : entry.list()) {
        polygon.points.push_back(point.point());
    }
    if (polygon.points.size() < 3) {
        entry.fail("a polygon has at least 3 points");
    }
    if (const std::size_t i = repeated_point(polygon.points, true); i < polygon.points.size()) {
        entry.fail(fmt::format("point {} repeats its neighbour; a polygon closes by itself", i));
    }
    if (!(area(polygon.points) > 0) || crosses_itself(polygon.points, true)) {
        entry.fail("a polygon must have an area and must not cross or touch itself");
    }
    return polygon;
}

/// Whether a shape's bounding box lies beside the rectangle from the origin to `size`.
bool lies_beside(const Shape& shape, const Vec2& size) {
    Vec2 low, high;
    if (const auto* circle = std::get_if<Circle>(&shape)) {
        low = circle->centre - Vec2::Constant(circle->radius);
        high = circle->centre + Vec2::Constant(circle->radius);
    } else {
        const std::vector<Vec2>& points = std::get<Polygon>(shape).points;
        low = high = points.front();
        for (const Vec2& point : points) {
            low = low.cwiseMin(point);
            high = high.cwiseMax(point);
        }
    }
    return (high.array() <= 0).any() || (low.array() >= size.array()).any();
}

Circle read_circle(const Entry& entry) {
    entry.only({"centre", "radius"});
    return {entry.at("centre").point(), entry.at("radius").number(limits::radius)};
}

Rings read_rings(const Entry& entry, const Materials& materials) {
    entry.only({"pith", "period", "latewood_fraction", "transition"});
    Rings rings;
    rings.pith = entry.at("pith").point();
    rings.period = entry.at("period").number(limits::period);
    rings.latewood_fraction = entry.at("latewood_fraction").number(limits::latewood_fraction);
    if (const auto transition = entry.find("transition")) {
        rings.transition = transition->number(limits::transition);
        check_rings(rings, transition->place(), transition->text());
    }
    for (const char* name : {"EW", "LW"}) {
        check_material(entry, name, materials);
    }
    return rings;
}

std::vector<GrayClass> read_classes(const Entry& entry, const Materials& materials) {
    std::vector<GrayClass> classes;
    for (const Entry& member : entry.list()) {
        member.only({"material", "gray"});
        GrayClass gray_class;
        const Entry material = member.at("material");
        gray_class.material = material.text();
        check_material(material, gray_class.material, materials);
        const Entry gray = member.at("gray");
        const std::vector<Entry> range = gray.list(2, "two grays from 0 to 255, such as [0, 127]");
        gray_class.low = range[0].integer(0, 255);
        gray_class.high = range[1].integer(0, 255);
        if (gray_class.low > gray_class.high) {
            gray.fail("the range is reversed: write the lower gray first");
        }
        for (const GrayClass& other : classes) {
            if (gray_class.low <= other.high && other.low <= gray_class.high) {
                gray.fail(fmt::format("overlaps the range {}..{} of material {}", other.low, other.high, other.material));
            }
        }
        classes.push_back(gray_class);
    }
    if (classes.empty()) {
        entry.fail("at least one class is needed");
    }
    return classes;
}

Vec2 read_offset(const Entry& specimen) {
    const auto offset = specimen.find("offset");
    return offset ? offset->point() : Vec2::Zero();
}

double read_rotation(const Entry& specimen) {
    const auto rotation = specimen.find("rotation");
    return rotation ? rotation->number(limits::rotation) : 0.0;
}

Picture read_picture_plan(const Entry& specimen, const Materials& materials) {
    Picture picture;
    picture.file = specimen.at("image").existing_file();
    picture.pixel = specimen.at("pixel").number(limits::pixel);
    picture.offset = read_offset(specimen);
    picture.rotation = read_rotation(specimen);
    picture.classes = read_classes(specimen.at("classes"), materials);
    if (const auto between = specimen.find("between")) {
        picture.graded = between->choice<bool>({{"graded", true}});
    }
    if (const auto orientation = specimen.find("orientation")) {
        picture.orientation = orientation->existing_file();
    }
    return picture;
}

/// Reads the keys that the scene gives; the others keep their defaults.
DensityExponents read_density_exponents(const Entry& entry) {
    entry.only({"E", "E_R", "E_T", "G_RT", "E_L", "toughness"});
    DensityExponents exponents;
    const auto read = [&](const char* key, auto& exponent) {
        if (const auto given = entry.find(key)) {
            exponent = given->number(limits::density_exponent);
        }
    };
    read("E", exponents.E);
    read("E_R", exponents.E_R);
    read("E_T", exponents.E_T);
    read("G_RT", exponents.G_RT);
    read("E_L", exponents.E_L);
    read("toughness", exponents.toughness);
    return exponents;
}

/// The radial direction by `radial` or `pith`, where nothing else gives it.
void read_radial_direction(const Entry& specimen, SpecimenPlan& plan) {
    for (const char* key : {"radial", "pith"}) {
        if (specimen.has(key) && plan.rings) {
            specimen.at(key).fail("the rings have a pith of their own, which gives the radial direction");
        }
        if (specimen.has(key) && plan.picture && !plan.picture->orientation.empty()) {
            specimen.at(key).fail("the picture in `orientation` gives the radial direction already");
        }
    }
    if (specimen.has("radial") && specimen.has("pith")) {
        specimen.at("pith").fail("give one of radial and pith");
    }
    if (const auto radial = specimen.find("radial")) {
        plan.radial = radial->number(limits::rotation);
    }
    if (const auto pith = specimen.find("pith")) {
        plan.pith = pith->point();
    }
}

/// Orthotropic wood needs a radial direction. A specimen's file may hold one: that is seen when it is read.
void check_radial_direction(const Entry& source, const SpecimenPlan& plan, const Materials& materials) {
    if (plan.rings || plan.radial || plan.pith || !plan.file.empty() || (plan.picture && !plan.picture->orientation.empty())) {
        return;
    }
    std::vector<std::string> used{plan.material};
    if (plan.picture) {
        used.clear();
        for (const GrayClass& gray_class : plan.picture->classes) {
            used.push_back(gray_class.material);
        }
    }
    for (const std::string& name : used) {
        if (materials.at(name).orthotropic) {
            source.fail(fmt::format("[materials.{}] is orthotropic: give its radial direction, as specimen.radial = \"30 deg\", "
                                    "specimen.pith, or a picture of angles in specimen.orientation",
                                    name));
        }
    }
}

/// Which of the four ways to say what the specimen is made of was used; exactly one must be.
std::string specimen_source(const Entry& specimen) {
    std::string source;
    for (const char* key : {"material", "rings", "image", "file"}) {
        if (!specimen.has(key)) {
            continue;
        }
        if (!source.empty()) {
            specimen.at(key).fail(fmt::format("give one of material, rings, image, file; there is \"{}\" already", source));
        }
        source = key;
    }
    if (source.empty()) {
        specimen.fail("what it is made of is missing: give one of material, rings, image, file");
    }
    return source;
}

void check_picture_keys(const Entry& specimen, const std::string& source) {
    for (const char* key : {"pixel", "classes", "orientation", "between"}) {
        if (specimen.has(key) && source != "image") {
            specimen.at(key).fail("needs an image: it has no meaning without one");
        }
    }
    for (const char* key : {"offset", "rotation"}) {
        if (specimen.has(key) && source != "image" && source != "file") {
            specimen.at(key).fail("needs an image or a file: it has no meaning without one");
        }
    }
}

}  // namespace

std::map<std::string, SceneNumber> exponent_numbers(const DensityExponents& exponents) {
    constexpr NumberRule rule = limits::density_exponent;
    std::map<std::string, SceneNumber> numbers{{"E_R", {&exponents.E_R, rule}},
                                               {"E_T", {&exponents.E_T, rule}},
                                               {"G_RT", {&exponents.G_RT, rule}},
                                               {"E_L", {&exponents.E_L, rule}}};
    if (exponents.E) {
        numbers.insert({"E", {&*exponents.E, rule}});
    }
    if (exponents.toughness) {
        numbers.insert({"toughness", {&*exponents.toughness, rule}});
    }
    return numbers;
}

void check_rings(const Rings& rings, const Place& place, const std::string& value) {
    constexpr double rounding = 1e-12;  // of decimals
    if (rings.transition + rings.latewood_fraction * rings.period > rings.period * (1 + rounding)) {
        throw InputError(place.file, place.key, value, "transition and latewood together are longer than the ring's period");
    }
}

Shape read_shape(const Entry& parent) {
    if (parent.has("circle") == parent.has("polygon")) {
        parent.fail("give one of circle and polygon");
    }
    return parent.has("circle") ? Shape(read_circle(parent.at("circle"))) : Shape(read_polygon(parent.at("polygon")));
}

namespace {

Part read_part(const Entry& entry) {
    entry.only({"polygon", "circle", "velocity"});
    Part part{read_shape(entry)};
    if (const auto velocity = entry.find("velocity")) {
        const std::vector<Entry> components = velocity->list(2, "two velocities, such as [\"10 m/s\", \"0 m/s\"]");
        part.velocity = {components[0].number(limits::velocity), components[1].number(limits::velocity)};
    }
    return part;
}

}  // namespace

SpecimenPlan read_specimen_plan(const Entry& specimen, const Materials& materials) {
    specimen.only({"size", "cutouts", "parts", "material", "rings", "image", "file", "pixel", "offset", "rotation", "classes",
                   "orientation", "between", "radial", "pith", "density_exponents"});
    SpecimenPlan plan;
    const std::vector<Entry> size = specimen.at("size").list(2, "two lengths, such as [\"10 mm\", \"10 mm\"]");
    plan.size = {size[0].number(limits::size), size[1].number(limits::size)};
    if (const auto cutouts = specimen.find("cutouts")) {
        for (const Entry& cutout : cutouts->list()) {
            cutout.only({"polygon", "circle"});
            plan.cutouts.push_back(read_shape(cutout));
            if (lies_beside(plan.cutouts.back(), plan.size)) {
                cutout.fail("lies beside the specimen: nothing would be cut out");
            }
        }
    }
    if (const auto parts = specimen.find("parts")) {
        for (const Entry& part : parts->list()) {
            plan.parts.push_back(read_part(part));
        }
    }
    const std::string source = specimen_source(specimen);
    check_picture_keys(specimen, source);
    const Entry entry = specimen.at(source);
    if (source == "material") {
        plan.material = entry.text();
        check_material(entry, plan.material, materials);
    } else if (source == "rings") {
        plan.rings = read_rings(entry, materials);
    } else if (source == "image") {
        plan.picture = read_picture_plan(specimen, materials);
    } else {
        plan.file = entry.existing_file();
        plan.file_offset = read_offset(specimen);
        plan.file_rotation = read_rotation(specimen);
    }
    if (const auto exponents = specimen.find("density_exponents")) {
        plan.density_exponents = read_density_exponents(*exponents);
    }
    read_radial_direction(specimen, plan);
    check_radial_direction(entry, plan, materials);
    return plan;
}

}  // namespace crampfit
