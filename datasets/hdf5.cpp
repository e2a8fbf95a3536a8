#include "datasets/hdf5.hpp"

#include "datasets/error.hpp"
#include "datasets/whole_file.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ranges.h>
#include <hdf5.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <numeric>
#include <stdexcept>

namespace crampfit::hdf5 {

namespace {

static_assert(std::is_same_v<hid_t, std::int64_t>);

constexpr std::size_t compress_from = 4096;    // [bytes]; below, a chunk's index costs more than compression saves
constexpr std::size_t chunk_bytes = 1u << 20;  // what HDF5's own chunk cache holds
constexpr unsigned compression_level = 4;      // higher ones cost time and save next to nothing on noisy floats

/// Errors come back as exceptions of ours; HDF5 would print its own account as well.
void silence() { H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr); }

struct Types {
    hid_t memory;
    hid_t file;
    H5T_class_t kind;
    std::size_t bytes;
};

Types types_of(Element element) {
    switch (element) {
    case Element::byte:
        return {H5T_NATIVE_UINT8, H5T_STD_U8LE, H5T_INTEGER, 1};
    case Element::integer:
        return {H5T_NATIVE_INT64, H5T_STD_I64LE, H5T_INTEGER, 8};
    case Element::single_precision:
        return {H5T_NATIVE_FLOAT, H5T_IEEE_F32LE, H5T_FLOAT, 4};
    case Element::double_precision:
        return {H5T_NATIVE_DOUBLE, H5T_IEEE_F64LE, H5T_FLOAT, 8};
    }
    throw std::logic_error("an element type without an HDF5 type");
}

Id text_type() {
    Id type(H5Tcopy(H5T_C_S1), H5Tclose);
    H5Tset_size(type.get(), H5T_VARIABLE);
    H5Tset_cset(type.get(), H5T_CSET_UTF8);
    return type;
}

Id space_of(const Shape& shape) {
    if (shape.empty()) return {H5Screate(H5S_SCALAR), H5Sclose};
    const std::vector<hsize_t> lengths(shape.begin(), shape.end());
    return {H5Screate_simple(static_cast<int>(lengths.size()), lengths.data(), nullptr), H5Sclose};
}

std::size_t product(const Shape& shape) {
    return std::accumulate(shape.begin(), shape.end(), std::size_t{1}, std::multiplies<>());
}

std::string in_words(const Shape& shape) {
    return shape.empty() ? "a single value" : fmt::format("[{}]", fmt::join(shape, " x "));
}

std::string in_words(const ExpectedShape& expected) {
    std::vector<std::string> lengths;
    for (const auto& length : expected) lengths.push_back(length ? std::to_string(*length) : "any");
    return lengths.empty() ? "a single value" : fmt::format("[{}]", fmt::join(lengths, " x "));
}

bool fits(const Shape& shape, const ExpectedShape& expected) {
    return std::equal(shape.begin(), shape.end(), expected.begin(), expected.end(),
                      [](std::size_t length, const auto& wanted) { return !wanted || *wanted == length; });
}

bool put_attribute(hid_t object, const std::string& name, const std::string& text) {
    const Id type = text_type();
    const Id space(H5Screate(H5S_SCALAR), H5Sclose);
    const Id attribute(H5Acreate2(object, name.c_str(), type.get(), space.get(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    const char* characters = text.c_str();
    return attribute.valid() && H5Awrite(attribute.get(), type.get(), &characters) >= 0;
}

std::string now_utc() {
    return fmt::format("{:%Y-%m-%dT%H:%M:%SZ}",
                       fmt::gmtime(std::chrono::system_clock::to_time_t(std::chrono::system_clock::now())));
}

}  // namespace

void Group::refuse(const std::string& name, const std::string& found, const std::string& rule) const {
    throw InputError(file_, path_ + name, found, rule);
}

void Group::check(bool succeeded, const std::string& name, const char* action) const {
    if (!succeeded) refuse(name, "damaged", fmt::format("HDF5 must be able to {} it", action));
}

Group Group::make_group(const std::string& name, const std::string& description) {
    Id id(H5Gcreate2(id_.get(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose);
    check(id.valid() && put_attribute(id.get(), "description", description), name, "create");
    return {std::move(id), file_, path_ + name + "/"};
}

bool Group::has(const std::string& name) const { return H5Lexists(id_.get(), name.c_str(), H5P_DEFAULT) > 0; }

Group Group::group(const std::string& name) const {
    if (!has(name)) refuse(name, "missing", "the file must hold this group");
    Id id(H5Gopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Gclose);
    check(id.valid(), name, "open");
    return {std::move(id), file_, path_ + name + "/"};
}

std::size_t Group::size() const {
    H5G_info_t info;
    check(H5Gget_info(id_.get(), &info) >= 0, "", "list");
    return info.nlinks;
}

void Group::set_attribute(const std::string& name, const std::string& text) {
    check(put_attribute(id_.get(), name, text), name, "write");
}

std::string Group::attribute(const std::string& name) const { return attribute_of(".", name); }

std::string Group::attribute_of(const std::string& dataset, const std::string& name) const {
    if (H5Aexists_by_name(id_.get(), dataset.c_str(), name.c_str(), H5P_DEFAULT) <= 0)
        refuse(name, "missing", "the file must carry this attribute");
    const Id attribute(H5Aopen_by_name(id_.get(), dataset.c_str(), name.c_str(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
    check(attribute.valid(), name, "open");
    const Id stored(H5Aget_type(attribute.get()), H5Tclose);
    const Id space(H5Aget_space(attribute.get()), H5Sclose);
    if (H5Tis_variable_str(stored.get()) <= 0 || H5Sget_simple_extent_npoints(space.get()) != 1)
        refuse(name, "another type", "must be one text");
    const Id type = text_type();
    char* characters = nullptr;
    check(H5Aread(attribute.get(), type.get(), &characters) >= 0, name, "read");
    std::string text = characters ? characters : "";
    H5free_memory(characters);
    return text;
}

Id Group::create_dataset(const std::string& name, std::int64_t type, const Shape& shape, std::size_t bytes_per_value) const {
    const Id space = space_of(shape);
    const Id properties(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
    if (!shape.empty() && product(shape) * bytes_per_value >= compress_from) {
        std::vector<hsize_t> chunk(shape.begin(), shape.end());
        const std::size_t row_bytes = product(shape) / shape.front() * bytes_per_value;
        chunk.front() = std::clamp<std::size_t>(chunk_bytes / row_bytes, 1, shape.front());
        H5Pset_chunk(properties.get(), static_cast<int>(chunk.size()), chunk.data());
        H5Pset_shuffle(properties.get());
        H5Pset_deflate(properties.get(), compression_level);
    }
    Id dataset(H5Dcreate2(id_.get(), name.c_str(), type, space.get(), H5P_DEFAULT, properties.get(), H5P_DEFAULT), H5Dclose);
    check(dataset.valid(), name, "create");
    return dataset;
}

void Group::write_numbers(const std::string& name, Element element, const void* values, std::size_t count, const Shape& shape,
                          const Meaning& meaning) {
    if (product(shape) != count)
        throw std::logic_error(fmt::format("{}{}: {} values do not fill {}", path_, name, count, in_words(shape)));
    const Types types = types_of(element);
    const Id dataset = create_dataset(name, types.file, shape, types.bytes);
    check(count == 0 || H5Dwrite(dataset.get(), types.memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name, "write");
    check(put_attribute(dataset.get(), "units", meaning.units), name, "write");
    check(put_attribute(dataset.get(), "description", meaning.description), name, "write");
}

void Group::write_strings(const std::string& name, const std::vector<std::string>& texts, const Shape& shape,
                          const std::string& description) {
    const Id type = text_type();
    const Id dataset = create_dataset(name, type.get(), shape, 0);
    std::vector<const char*> characters;
    for (const std::string& text : texts) characters.push_back(text.c_str());
    check(texts.empty() || H5Dwrite(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, characters.data()) >= 0, name,
          "write");
    check(put_attribute(dataset.get(), "description", description), name, "write");
}

void Group::write_text(const std::string& name, const std::string& text, const std::string& description) {
    write_strings(name, {text}, {}, description);
}

void Group::write_texts(const std::string& name, const std::vector<std::string>& texts, const std::string& description) {
    write_strings(name, texts, {texts.size()}, description);
}

Id Group::open_dataset(const std::string& name) const {
    if (!has(name)) refuse(name, "missing", "the file must hold this dataset");
    Id dataset(H5Dopen2(id_.get(), name.c_str(), H5P_DEFAULT), H5Dclose);
    check(dataset.valid(), name, "open");
    return dataset;
}

Shape Group::checked_shape(const std::string& name, const Id& dataset, const ExpectedShape& expected) const {
    const Id space(H5Dget_space(dataset.get()), H5Sclose);
    const int dimensions = H5Sget_simple_extent_ndims(space.get());
    check(dimensions >= 0, name, "measure");
    std::vector<hsize_t> lengths(static_cast<std::size_t>(dimensions));
    H5Sget_simple_extent_dims(space.get(), lengths.data(), nullptr);
    const Shape shape(lengths.begin(), lengths.end());
    if (!fits(shape, expected)) refuse(name, in_words(shape), "the shape must be " + in_words(expected));
    return shape;
}

void Group::read_numbers(const std::string& name, Element element, const ExpectedShape& expected, Shape& shape,
                         const std::function<void*(std::size_t)>& make_room) const {
    const Id dataset = open_dataset(name);
    const Id stored(H5Dget_type(dataset.get()), H5Tclose);
    const Types types = types_of(element);
    if (H5Tget_class(stored.get()) != types.kind || H5Tget_size(stored.get()) > types.bytes)
        refuse(name, "another type",
               fmt::format("must hold {} of at most {} bytes", types.kind == H5T_FLOAT ? "floating-point numbers" : "integers",
                           types.bytes));
    shape = checked_shape(name, dataset, expected);
    const std::size_t count = product(shape);
    void* values = make_room(count);
    check(count == 0 || H5Dread(dataset.get(), types.memory, H5S_ALL, H5S_ALL, H5P_DEFAULT, values) >= 0, name, "read");
}

std::vector<std::string> Group::read_strings(const std::string& name, const ExpectedShape& expected) const {
    const Id dataset = open_dataset(name);
    const Id stored(H5Dget_type(dataset.get()), H5Tclose);
    if (H5Tis_variable_str(stored.get()) <= 0) refuse(name, "another type", "must hold text of any length");
    const std::size_t count = product(checked_shape(name, dataset, expected));
    if (count == 0) return {};
    const Id type = text_type();
    const Id space(H5Dget_space(dataset.get()), H5Sclose);
    std::vector<char*> characters(count, nullptr);
    check(H5Dread(dataset.get(), type.get(), H5S_ALL, H5S_ALL, H5P_DEFAULT, characters.data()) >= 0, name, "read");
    std::vector<std::string> texts;
    for (const char* text : characters) texts.emplace_back(text ? text : "");
    H5Dvlen_reclaim(type.get(), space.get(), H5P_DEFAULT, characters.data());
    return texts;
}

std::string Group::read_text(const std::string& name) const { return read_strings(name, {}).front(); }

std::vector<std::string> Group::read_texts(const std::string& name, std::optional<std::size_t> rows) const {
    return read_strings(name, {rows});
}

Group open(const std::filesystem::path& file) {
    silence();
    const std::string name = file.string();
    std::error_code error;
    if (!std::filesystem::exists(file, error)) throw InputError(name, "", "", "the file does not exist");
    if (!std::filesystem::is_regular_file(file, error)) throw InputError(name, "", "", "must be a plain file");
    if (H5Fis_hdf5(name.c_str()) <= 0) throw InputError(name, "", "", "cannot be read as an HDF5 file");
    const Id id(H5Fopen(name.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
    if (!id.valid()) throw InputError(name, "", "", "is damaged: HDF5 must be able to open it");
    // The root keeps the file open after `id` has gone.
    Group root(Id(H5Gopen2(id.get(), "/", H5P_DEFAULT), H5Gclose), name, "");
    if (root.attribute("program") != "crampfit")
        root.refuse("program", root.attribute("program"), "the file must have been written by crampfit");
    return root;
}

Group open(const std::filesystem::path& file, const std::string& kind) {
    Group root = open(file);
    const std::string found = root.attribute("kind");
    if (found != kind) root.refuse("kind", found, fmt::format("a {} file is needed here", kind));
    return root;
}

void save(const std::filesystem::path& file, const std::string& kind, const std::function<void(Group&)>& fill) {
    silence();
    require_writable(file);
    const std::string name = file.string();
    // The file is made in memory, so that a full disk meets our own checked write: HDF5 cannot close a file that it
    // could not flush.
    const Id access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
    H5Pset_fapl_core(access.get(), chunk_bytes, false);
    const Id id(H5Fcreate(name.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.get()), H5Fclose);
    if (!id.valid()) throw InputError(name, "", "", "HDF5 could not make the file in memory");
    {
        Group root(Id(H5Gopen2(id.get(), "/", H5P_DEFAULT), H5Gclose), name, "");
        root.set_attribute("program", "crampfit");
        root.set_attribute("version", CRAMPFIT_VERSION);
        root.set_attribute("kind", kind);
        root.set_attribute("created", now_utc());
        fill(root);
    }
    const bool flushed = H5Fflush(id.get(), H5F_SCOPE_LOCAL) >= 0;
    const ssize_t bytes = flushed ? H5Fget_file_image(id.get(), nullptr, 0) : -1;
    if (bytes < 0) throw InputError(name, "", "", "HDF5 could not finish the file");
    std::string image(static_cast<std::size_t>(bytes), '\0');
    if (H5Fget_file_image(id.get(), image.data(), image.size()) != bytes)
        throw InputError(name, "", "", "HDF5 could not finish the file");
    write_whole_file(file, image);
}

}  // namespace crampfit::hdf5
