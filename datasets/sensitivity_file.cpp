#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"

#include <limits>
#include <stdexcept>

namespace crampfit {

using hdf5::Group;

namespace {

template <class Row>
struct TextColumn {
    const char* name;
    std::string Row::*value;
    const char* description;
};
template <class Row>
struct NumberColumn {
    const char* name;
    double Row::*value;
    const char* units;
    const char* description;
};

constexpr TextColumn<StudiedParameter> parameter_texts[] = {
    {"name", &StudiedParameter::name, "name in the study"},
    {"key", &StudiedParameter::key, "keys of the scenes, with a space between"},
    {"unit", &StudiedParameter::unit, "unit of this parameter's numbers; empty for a pure number"},
};
constexpr NumberColumn<StudiedParameter> parameter_numbers[] = {
    {"initial", &StudiedParameter::initial, "of parameters/unit", "where local derivatives are taken"},
    {"lower", &StudiedParameter::lower, "of parameters/unit", "lower bound"},
    {"upper", &StudiedParameter::upper, "of parameters/unit", "upper bound"},
};
constexpr TextColumn<StudiedOutput> output_texts[] = {
    {"name", &StudiedOutput::name, "name in the study"},
    {"unit", &StudiedOutput::unit, "unit of this output's numbers"},
};
constexpr TextColumn<SensitivityIndex> index_texts[] = {
    {"output", &SensitivityIndex::output, "what answers"},
    {"parameter", &SensitivityIndex::parameter, "to what it answers"},
    {"method", &SensitivityIndex::method, "local, morris or sobol"},
    {"kind", &SensitivityIndex::kind,
     "derivative: outputs/unit for each parameters/unit; mu_star, sigma: outputs/unit for the whole way from lower to upper; "
     "elasticity, first, total: pure numbers"},
};
constexpr NumberColumn<SensitivityIndex> index_numbers[] = {
    {"value", &SensitivityIndex::value, "see kind", "the index"},
    {"lower_95", &SensitivityIndex::lower_95, "see kind", "lower end of the 95 % interval"},
    {"upper_95", &SensitivityIndex::upper_95, "see kind", "upper end of the 95 % interval"},
};

template <class Row, std::size_t Size>
void write_columns(Group& group, const std::vector<Row>& rows, const TextColumn<Row> (&columns)[Size]) {
    for (const auto& column : columns) {
        std::vector<std::string> texts;
        for (const Row& row : rows) texts.push_back(row.*column.value);
        group.write_texts(column.name, texts, column.description);
    }
}

template <class Row, std::size_t Size>
void write_columns(Group& group, const std::vector<Row>& rows, const NumberColumn<Row> (&columns)[Size]) {
    for (const auto& column : columns) {
        std::vector<double> numbers;
        for (const Row& row : rows) numbers.push_back(row.*column.value);
        group.write(column.name, numbers, {column.units, column.description});
    }
}

template <class Row, std::size_t Size>
void read_columns(const Group& group, std::vector<Row>& rows, const TextColumn<Row> (&columns)[Size]) {
    rows.resize(group.read_texts(columns[0].name).size());
    for (const auto& column : columns) {
        const auto texts = group.read_texts(column.name, rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) rows[i].*column.value = texts[i];
    }
}

template <class Row, std::size_t Size>
void read_columns(const Group& group, std::vector<Row>& rows, const NumberColumn<Row> (&columns)[Size]) {
    for (const auto& column : columns) {
        const auto numbers = group.read_column<double>(column.name, rows.size());
        for (std::size_t i = 0; i < rows.size(); ++i) rows[i].*column.value = numbers[i];
    }
}

// ---- runs

void write_matrix(Group& group, const char* matrix_name, const std::vector<SensitivityRun>& runs,
                  std::vector<double> SensitivityRun::*member, std::size_t columns, const hdf5::Meaning& meaning) {
    std::vector<double> values;
    for (const SensitivityRun& run : runs) values.insert(values.end(), (run.*member).begin(), (run.*member).end());
    group.write(matrix_name, values, {runs.size(), columns}, meaning);
}

void read_matrix(const Group& group, const char* matrix_name, std::vector<SensitivityRun>& runs,
                 std::vector<double> SensitivityRun::*member, std::size_t columns) {
    const auto [shape, values] = group.read<double>(matrix_name, {runs.size(), columns});
    for (std::size_t i = 0; i < runs.size(); ++i)
        (runs[i].*member).assign(values.data() + i * columns, values.data() + (i + 1) * columns);
}

void write_runs(Group& root, const Sensitivity& sensitivity) {
    Group group = root.make_group("runs", "every forward run; the table `runs`");
    const std::vector<SensitivityRun>& runs = sensitivity.runs;
    write_matrix(group, "parameters", runs, &SensitivityRun::parameters, sensitivity.parameters.size(),
                 {"of parameters/unit", "a row a run, a column a parameter"});
    write_matrix(group, "outputs", runs, &SensitivityRun::outputs, sensitivity.outputs.size(),
                 {"of outputs/unit", "a row a run, a column an output; not a number where the run has no such output"});
    std::vector<std::string> status;
    std::vector<double> seconds;
    for (const SensitivityRun& run : runs) {
        status.push_back(run.status);
        seconds.push_back(run.seconds);
    }
    group.write_texts("status", status, "how the run ended");
    group.write("seconds", seconds, {"s", "wall time of the run"});
}

void read_runs(const Group& group, Sensitivity& sensitivity) {
    const auto status = group.read_texts("status");
    const auto seconds = group.read_column<double>("seconds", status.size());
    sensitivity.runs.resize(status.size());
    for (std::size_t i = 0; i < status.size(); ++i) {
        sensitivity.runs[i].status = status[i];
        sensitivity.runs[i].seconds = seconds[i];
    }
    read_matrix(group, "parameters", sensitivity.runs, &SensitivityRun::parameters, sensitivity.parameters.size());
    read_matrix(group, "outputs", sensitivity.runs, &SensitivityRun::outputs, sensitivity.outputs.size());
}

SensitivityStatus read_status(const Group& root) {
    const std::string text = root.read_text("status");
    for (const auto status : {SensitivityStatus::finished, SensitivityStatus::interrupted, SensitivityStatus::failed})
        if (text == name(status)) return status;
    root.refuse("status", text, "must be finished, interrupted or failed");
}

unsigned read_seed(const Group& root) {
    const auto seed = root.read_number<std::int64_t>("seed");
    if (seed < 0 || seed > std::numeric_limits<unsigned>::max())
        root.refuse("seed", std::to_string(seed), "must fit into 32 bits without sign");
    return static_cast<unsigned>(seed);
}

}  // namespace

const char* name(SensitivityStatus status) {
    switch (status) {
    case SensitivityStatus::finished:
        return "finished";
    case SensitivityStatus::interrupted:
        return "interrupted";
    case SensitivityStatus::failed:
        return "failed";
    }
    throw std::logic_error("a sensitivity status without a name");
}

void write(const Sensitivity& sensitivity, const std::filesystem::path& file) {
    hdf5::save(file, "sensitivity", [&](Group& root) {
        root.write_text("status", name(sensitivity.status), "how the study ended");
        root.write_text("message", sensitivity.message, "what there is to know about it");
        root.write_text("study_text", sensitivity.study_text, "the study in TOML as it was used");
        root.write_text("scene_settings", sensitivity.scene_settings, "what --set changed in the scenes");
        root.write<std::int64_t>("seed", sensitivity.seed, {"1", "of everything that was drawn at random"});
        root.write("seconds", sensitivity.seconds, {"s", "wall time of the study"});
        Group parameters = root.make_group("parameters", "what was varied");
        write_columns(parameters, sensitivity.parameters, parameter_texts);
        write_columns(parameters, sensitivity.parameters, parameter_numbers);
        Group outputs = root.make_group("outputs", "what was looked at");
        write_columns(outputs, sensitivity.outputs, output_texts);
        Group indices = root.make_group("indices", "how each output answers to each parameter; the table `indices`");
        write_columns(indices, sensitivity.indices, index_texts);
        write_columns(indices, sensitivity.indices, index_numbers);
        write_runs(root, sensitivity);
    });
}

Sensitivity read_sensitivity(const std::filesystem::path& file) {
    const Group root = hdf5::open(file, "sensitivity");
    Sensitivity sensitivity;
    sensitivity.status = read_status(root);
    sensitivity.message = root.read_text("message");
    sensitivity.study_text = root.read_text("study_text");
    if (root.has("scene_settings")) sensitivity.scene_settings = root.read_text("scene_settings");
    sensitivity.seed = read_seed(root);
    sensitivity.seconds = root.read_number<double>("seconds");
    read_columns(root.group("parameters"), sensitivity.parameters, parameter_texts);
    read_columns(root.group("parameters"), sensitivity.parameters, parameter_numbers);
    read_columns(root.group("outputs"), sensitivity.outputs, output_texts);
    read_columns(root.group("indices"), sensitivity.indices, index_texts);
    read_columns(root.group("indices"), sensitivity.indices, index_numbers);
    read_runs(root.group("runs"), sensitivity);
    return sensitivity;
}

}  // namespace crampfit
