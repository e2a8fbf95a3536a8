#pragma once

#include <Eigen/Core>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

/// The one layer over the HDF5 C interface: identifiers that close themselves, whole arrays in and out, every failure
/// an InputError that names file, dataset and rule. HDF5 as it is packaged serves one thread at a time; so does this.
namespace crampfit::hdf5 {

/// Owns an identifier of any kind.
class Id {
  public:
    using Close = int (*)(std::int64_t);
    Id(std::int64_t id, Close close) : id_(id), close_(close) {}
    Id(Id&& other) noexcept : id_(std::exchange(other.id_, -1)), close_(other.close_) {}
    Id& operator=(Id&&) = delete;
    ~Id() {
        if (id_ >= 0) close_(id_);
    }
    std::int64_t get() const { return id_; }
    bool valid() const { return id_ >= 0; }

  private:
    std::int64_t id_;
    Close close_;
};

/// Lengths of a dataset's dimensions; none for a single number.
using Shape = std::vector<std::size_t>;

/// What a shape must be; a dimension without a value may have any length.
using ExpectedShape = std::vector<std::optional<std::size_t>>;

/// What a dataset's numbers are: written beside them, so that the file explains itself.
struct Meaning {
    std::string units;  // "1" for pure numbers
    std::string description;
};

/// Kinds of numbers that files hold.
enum class Element { byte, integer, single_precision, double_precision };

template <class T>
inline constexpr Element element_of = Element::double_precision;
template <>
inline constexpr Element element_of<std::uint8_t> = Element::byte;
template <>
inline constexpr Element element_of<std::int64_t> = Element::integer;
template <>
inline constexpr Element element_of<float> = Element::single_precision;

template <class T>
concept Number =
    std::is_same_v<T, std::uint8_t> || std::is_same_v<T, std::int64_t> || std::is_same_v<T, float> || std::is_same_v<T, double>;

template <Number T>
struct Array {
    Shape shape;
    std::vector<T> values;  // last dimension fastest
};

/// A group of a file, or the file's root.
class Group {
  public:
    Group(Id id, std::string file, std::string path) : id_(std::move(id)), file_(std::move(file)), path_(std::move(path)) {}

    Group make_group(const std::string& name, const std::string& description);
    Group group(const std::string& name) const;
    bool has(const std::string& name) const;
    std::size_t size() const;  // how many things lie directly in it

    void set_attribute(const std::string& name, const std::string& text);
    std::string attribute(const std::string& name) const;
    std::string attribute_of(const std::string& dataset, const std::string& name) const;

    /// The product of `shape` is the number of values. Large arrays are compressed.
    template <Number T>
    void write(const std::string& name, const std::vector<T>& values, const Shape& shape, const Meaning& meaning) {
        write_numbers(name, element_of<T>, values.data(), values.size(), shape, meaning);
    }
    template <Number T>
    void write(const std::string& name, const std::vector<T>& column, const Meaning& meaning) {
        write(name, column, {column.size()}, meaning);
    }
    template <Number T>
    void write(const std::string& name, T value, const Meaning& meaning) {
        write(name, std::vector<T>{value}, {}, meaning);
    }
    /// Small vectors of `Size` components become rows of an array.
    template <Number T, int Size>
    void write(const std::string& name, const std::vector<Eigen::Matrix<T, Size, 1>>& rows, const Meaning& meaning) {
        const T* first = rows.empty() ? nullptr : rows.front().data();
        write_numbers(name, element_of<T>, first, rows.size() * Size, {rows.size(), Size}, meaning);
    }
    void write_text(const std::string& name, const std::string& text, const std::string& description);
    void write_texts(const std::string& name, const std::vector<std::string>& texts, const std::string& description);

    template <Number T>
    Array<T> read(const std::string& name, const ExpectedShape& expected) const {
        Array<T> array;
        read_numbers(name, element_of<T>, expected, array.shape, [&](std::size_t count) {
            array.values.resize(count);
            return array.values.data();
        });
        return array;
    }
    template <Number T>
    T read_number(const std::string& name) const {
        return read<T>(name, {}).values.front();
    }
    /// Without `rows`: any number of rows.
    template <Number T>
    std::vector<T> read_column(const std::string& name, std::optional<std::size_t> rows = std::nullopt) const {
        return read<T>(name, {rows}).values;
    }
    template <Number T, int Size>
    std::vector<Eigen::Matrix<T, Size, 1>> read_rows(const std::string& name,
                                                     std::optional<std::size_t> rows = std::nullopt) const {
        const Array<T> array = read<T>(name, {rows, Size});
        std::vector<Eigen::Matrix<T, Size, 1>> vectors(array.shape.front());
        for (std::size_t i = 0; i < vectors.size(); ++i)
            vectors[i] = Eigen::Map<const Eigen::Matrix<T, Size, 1>>(array.values.data() + i * Size);
        return vectors;
    }
    std::string read_text(const std::string& name) const;
    std::vector<std::string> read_texts(const std::string& name, std::optional<std::size_t> rows = std::nullopt) const;

    /// Throws the InputError that says what is wrong with the dataset or group `name` of this group.
    [[noreturn]] void refuse(const std::string& name, const std::string& found, const std::string& rule) const;

  private:
    void write_numbers(const std::string& name, Element element, const void* values, std::size_t count, const Shape& shape,
                       const Meaning& meaning);
    void read_numbers(const std::string& name, Element element, const ExpectedShape& expected, Shape& shape,
                      const std::function<void*(std::size_t)>& make_room) const;
    void write_strings(const std::string& name, const std::vector<std::string>& texts, const Shape& shape,
                       const std::string& description);
    std::vector<std::string> read_strings(const std::string& name, const ExpectedShape& expected) const;
    Id create_dataset(const std::string& name, std::int64_t type, const Shape& shape, std::size_t bytes_per_value) const;
    Id open_dataset(const std::string& name) const;
    Shape checked_shape(const std::string& name, const Id& dataset, const ExpectedShape& expected) const;
    void check(bool succeeded, const std::string& name, const char* action) const;

    Id id_;
    std::string file_;
    std::string path_;  // from the root, with a slash at the end; empty for the root
};

/// Opens a file for reading and gives its root. Throws InputError when it is not a file of this program.
Group open(const std::filesystem::path& file);

/// As above, and the file must be of this kind: "specimen", "record", "fit", "sensitivity".
Group open(const std::filesystem::path& file, const std::string& kind);

/// Makes a file of this kind: `fill` gets the root. The file appears under its name when it is whole, or not at all.
void save(const std::filesystem::path& file, const std::string& kind, const std::function<void(Group&)>& fill);

}  // namespace crampfit::hdf5
