// The Python module: what the command does, with results as numpy arrays.
//
//     import crampfit
//     record = crampfit.simulate("scene.toml", set={"materials.EW.E": "50 MPa"})
//     series = record.table("series")              # as `crampfit csv` has it: {"time_s": array, "force_N": array, ...}
//     fit = crampfit.fit("study.toml", threads=2)
//     fit.table("parameters"), fit.covariance
#include "datasets/error.hpp"
#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"
#include "datasets/tables.hpp"
#include "forward/simulate.hpp"
#include "imaging/photograph.hpp"
#include "imaging/picture.hpp"
#include "inverse/compare.hpp"
#include "inverse/crack_paths.hpp"
#include "inverse/pool.hpp"
#include "inverse/sensitivity.hpp"

#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <cmath>
#include <exception>
#include <fstream>
#include <sstream>
#include <string_view>
#include <thread>

namespace py = pybind11;

namespace crampfit {
namespace {

using Path = std::filesystem::path;

/// A value as TOML has it. A text of its own is one already, as --set takes it: "50 MPa", "[1, 2]"; one within a list or a dict
/// is a string.
std::string toml_text(const py::handle& value, bool within = false) {
    if (py::isinstance<py::bool_>(value)) {
        return value.cast<bool>() ? "true" : "false";
    }
    if (py::isinstance<py::str>(value)) {
        return within ? py::module_::import("json").attr("dumps")(value, py::arg("ensure_ascii") = false).cast<std::string>()
                      : value.cast<std::string>();
    }
    if (py::isinstance<py::dict>(value)) {
        std::string text;
        for (const auto& [key, entry] : py::reinterpret_borrow<py::dict>(value)) {
            text += (text.empty() ? "" : ", ") + toml_text(py::str(key), true) + " = " + toml_text(entry, true);
        }
        return "{" + text + "}";
    }
    if (py::isinstance<py::list>(value) || py::isinstance<py::tuple>(value)) {
        std::string text;
        for (const auto& entry : value) {
            text += (text.empty() ? "" : ", ") + toml_text(entry, true);
        }
        return "[" + text + "]";
    }
    if (py::hasattr(value, "tolist")) {  // numpy's arrays and numbers
        return toml_text(value.attr("tolist")(), within);
    }
    return py::str(value);
}

Overrides overrides_of(const py::dict& settings) {
    Overrides overrides;
    for (const auto& [key, value] : settings) {
        overrides.emplace_back(py::str(key), toml_text(value));
    }
    return overrides;
}

/// Runs it on a thread of its own, so that Python hears of Ctrl-C meanwhile, which asks it to stop; what a signal's handler
/// raises, such as KeyboardInterrupt, is raised once it has.
template <class Work>
auto interruptible(const Work& work) {
    std::atomic<bool> stop{false}, done{false};
    std::optional<decltype(work(&stop))> result;
    std::exception_ptr thrown;
    std::optional<py::error_already_set> raised;
    {
        const std::jthread worker([&] {
            try {
                result = work(&stop);
            } catch (...) {  // kept for Python's thread, which throws it again
                thrown = std::current_exception();
            }
            done = true;
        });
        const py::gil_scoped_release others_may_run;
        while (!done) {
            std::this_thread::sleep_for(std::chrono::milliseconds(5));
            const py::gil_scoped_acquire python;
            if (!raised && PyErr_CheckSignals() != 0) {
                raised.emplace();
                stop = true;
            }
        }
    }
    if (raised) {
        throw py::error_already_set(*raised);
    }
    if (thrown) {
        std::rethrow_exception(thrown);
    }
    return std::move(*result);
}

// ---- tables

std::vector<std::vector<std::string>> rows_of(const std::string& csv) {
    std::vector<std::vector<std::string>> rows(1, {""});
    bool quoted = false;
    for (std::size_t i = 0; i < csv.size(); ++i) {
        const char c = csv[i];
        std::string& field = rows.back().back();
        if (quoted && c == '"' && i + 1 < csv.size() && csv[i + 1] == '"') {
            field += csv[++i];
        } else if (c == '"') {
            quoted = !quoted;
        } else if (c == ',' && !quoted) {
            rows.back().emplace_back();
        } else if (c == '\n' && !quoted) {
            rows.push_back({""});
        } else {
            field += c;
        }
    }
    rows.pop_back();
    return rows;
}

std::optional<double> number(const std::string& text) {
    double value = 0;
    const auto [rest, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    return error == std::errc() && rest == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

/// Columns by their names: numbers or truth values where all are, else texts.
template <class Result>
py::dict table(const Result& result, const std::string& name) {
    std::ostringstream csv;
    print_table(result, name, csv);
    const auto rows = rows_of(csv.str());
    py::dict columns;
    for (std::size_t c = 0; c < rows[0].size(); ++c) {
        std::vector<double> numbers;
        py::list texts;
        for (std::size_t r = 1; r < rows.size(); ++r) {
            texts.append(rows[r][c]);
            if (const auto value = number(rows[r][c])) {
                numbers.push_back(*value);
            }
        }
        const py::object array = py::module_::import("numpy").attr("array");
        const auto is_truth = [&](const auto& row) { return row[c] == "true" || row[c] == "false"; };
        py::object column;
        if (numbers.size() + 1 == rows.size()) {
            column = py::array_t<double>(static_cast<py::ssize_t>(numbers.size()), numbers.data());
        } else if (std::all_of(rows.begin() + 1, rows.end(), is_truth)) {
            column = array(texts).attr("__eq__")("true");
        } else {
            column = array(texts);
        }
        columns[py::str(rows[0][c])] = column;
    }
    return columns;
}

/// Writes a result as HDF5, over no file of another kind, such as the scene that it came from.
template <class Result>
void save(const Result& result, const Path& file) {
    constexpr std::string_view signature = "\x89HDF\r\n\x1a\n";  // of HDF5
    if (std::ifstream before(file, std::ios::binary); before) {
        std::string begin(signature.size(), '\0');
        before.read(begin.data(), static_cast<std::streamsize>(begin.size()));
        if (before.gcount() > 0 && begin != signature) {
            throw InputError(file.string(), "", "", "is a file of another kind, which HDF5 is not to replace");
        }
    }
    write(result, file);
}

template <class Result>
void bind_tables(py::class_<Result>& type) {
    type.def_property_readonly(
        "tables", [](const Result& result) { return table_names(result); }, "names of its tables");
    type.def("table", &table<Result>, py::arg("name"), "one of its tables: a dict of columns, as `crampfit csv` prints them");
    type.def("save", &save<Result>, py::arg("file"), "writes it as HDF5");
    type.def_property_readonly(
        "status", [](const Result& result) { return std::string(name(result.status)); }, "how it ended, a word");
    type.def_readonly("message", &Result::message, "why it ended, for a person");
    type.def_readonly("seconds", &Result::seconds, "that it took");
    type.def("__repr__", [type = py::str(type.attr("__name__")).cast<std::string>()](const Result& result) {
        return "<crampfit." + type + ": " + std::string(name(result.status)) + ">";
    });
}

template <class Vector>
py::array_t<double> matrix(const std::vector<Vector>& rows) {
    constexpr py::ssize_t columns = Vector::RowsAtCompileTime;
    py::array_t<double> array({static_cast<py::ssize_t>(rows.size()), columns});
    auto to = array.template mutable_unchecked<2>();
    for (py::ssize_t i = 0; i < to.shape(0); ++i) {
        for (py::ssize_t k = 0; k < columns; ++k) {
            to(i, k) = static_cast<double>(rows[static_cast<std::size_t>(i)][k]);
        }
    }
    return array;
}

py::list frames(const Record& record) {
    py::list list;
    for (const Frame& frame : record.frames) {
        py::dict entry;
        entry["time_s"] = frame.time;
        entry["displacement_m"] = frame.displacement;
        entry["moved_m"] = matrix(frame.moved);
        entry["stress_Pa"] = matrix(frame.stress);
        entry["crack_m"] = matrix(frame.crack);
        list.append(entry);
    }
    return list;
}

// ---- verbs

Scene open_scene(const Path& file, const py::dict& settings) {
    Scene scene = read_scene(file, overrides_of(settings));
    load_specimen(scene);
    return scene;
}

Study open_study(const Path& file, const py::dict& settings) {
    Study study = read_study(file, overrides_of(settings));
    load_pictures(study);
    return study;
}

Record run_scene(const Path& file, const py::dict& settings, int threads) {
    const Scene scene = open_scene(file, settings);
    return interruptible([&](const std::atomic<bool>* stop) {
        SimulateOptions options;
        options.threads = thread_count(threads);
        options.stop_requested = stop;
        return simulate(scene, options);
    });
}

template <class Options>
Options options_of(int threads, const std::optional<Path>& keep, bool resume) {
    Options options;
    options.threads = threads;
    if (keep) {
        options.keeping = {*keep, resume};
    } else if (resume) {
        throw InputError("arguments", "resume", "True", "needs `keep`, the file of the runs to go on from");
    }
    return options;
}

Fit run_fit(const Path& file, const py::dict& settings, int threads, const std::optional<Path>& keep, bool resume) {
    const Study study = open_study(file, settings);
    auto options = options_of<FitOptions>(threads, keep, resume);
    return interruptible([&](const std::atomic<bool>* stop) {
        options.stop_requested = stop;
        Fit fit = fit_models(study, options);
        fit.crack_paths = crack_paths(study, fit, threads, stop);
        return fit;
    });
}

Sensitivity run_sensitivity(const Path& file, const py::dict& settings, int threads, const std::optional<Path>& keep,
                            bool resume) {
    const Study study = open_study(file, settings);
    auto options = options_of<SensitivityOptions>(threads, keep, resume);
    return interruptible([&](const std::atomic<bool>* stop) {
        options.stop_requested = stop;
        return study_sensitivity(study, options);
    });
}

/// In the parameters' units, by name; those that are not given have their initial values.
Eigen::VectorXd values_of(const Study& study, const std::map<std::string, double>& given) {
    Eigen::VectorXd values(static_cast<Eigen::Index>(study.parameters.size()));
    for (std::size_t j = 0; j < study.parameters.size(); ++j) {
        const Parameter& parameter = study.parameters[j];
        const auto found = given.find(parameter.name);
        double& value = values[static_cast<Eigen::Index>(j)];
        value = found != given.end() ? found->second * parameter.unit_factor : parameter.initial;
        constexpr double rounding = 1e-12;  // of a bound, in another unit
        if (!(value >= parameter.lower - rounding * std::abs(parameter.lower) &&
              value <= parameter.upper + rounding * std::abs(parameter.upper))) {
            throw InputError("values", parameter.name, fmt::format("{:g} {}", found->second, parameter.unit),
                             fmt::format("must lie within the study's bounds, {:g} to {:g} {}",
                                         parameter.lower / parameter.unit_factor, parameter.upper / parameter.unit_factor,
                                         parameter.unit));
        }
    }
    for (const auto& [name, value] : given) {
        const bool known =
            std::any_of(study.parameters.begin(), study.parameters.end(), [&](const Parameter& p) { return p.name == name; });
        if (!known) {
            throw InputError(study.file.string(), name, std::to_string(value), "is no parameter of the study");
        }
    }
    return values;
}

py::object run_evaluation(const Path& file, const std::map<std::string, double>& given, const py::dict& settings, int threads,
                          bool gradient) {
    const Study study = open_study(file, settings);
    const Eigen::VectorXd values = values_of(study, given);
    const bool of_outputs = !study.outputs.empty();
    const Evaluation evaluation = interruptible([&](const std::atomic<bool>* stop) {
        return (of_outputs ? output_function(study, stop) : fit_function(study, stop))(values, thread_count(threads));
    });
    if (!evaluation.usable()) {
        throw std::runtime_error(evaluation.status);
    }
    if (!gradient) {
        return py::cast(evaluation.residuals);
    }
    std::optional<Eigen::MatrixXd> slopes = interruptible([&](const std::atomic<bool>* stop) {
        return of_outputs ? output_slopes(study, values, stop) : fit_slopes(study, values, stop);
    });
    if (!slopes) {
        throw std::runtime_error("the solver has no derivatives that hold for this study");
    }
    for (std::size_t j = 0; j < study.parameters.size(); ++j) {
        slopes->col(static_cast<Eigen::Index>(j)) *= study.parameters[j].unit_factor;
    }
    return py::make_tuple(evaluation.residuals, *slopes);
}

py::object load(const Path& file) {
    const std::string kind = hdf5::open(file).attribute("kind");
    if (kind == "record") {
        return py::cast(read_record(file));
    }
    if (kind == "fit") {
        return py::cast(read_fit(file));
    }
    if (kind == "sensitivity") {
        return py::cast(read_sensitivity(file));
    }
    throw InputError(file.string(), "kind", kind, "must be record, fit or sensitivity");
}

void bind_results(py::module_& module) {
    py::class_<Record> record(module, "Record", "What a run gives.");
    bind_tables(record);
    record.def_property_readonly(
        "points", [](const Record& r) { return matrix(r.point_position); }, "undeformed places [points x 2], m");
    record.def_property_readonly("frames", &frames,
                                 "the points at some instants, where the scene asks for frames: dicts of time_s, displacement_m, "
                                 "moved_m [points x 2], stress_Pa [points x 4] (xx, yy, xy, zz) and crack_m [corners x 2]");

    py::class_<Fit> fit(module, "Fit", "What a fit gives.");
    bind_tables(fit);
    fit.def_readonly("method", &Fit::method, "how the search went, for a person");
    fit.def_readonly("misfit", &Fit::misfit, "sum of squared weighted residuals");
    fit.def_readonly("reduced_chi_square", &Fit::reduced_chi_square, "of the data, over their degrees of freedom");
    fit.def_readonly("covariance", &Fit::covariance, "[parameters x parameters], in their units");
    fit.def_readonly("correlation", &Fit::correlation, "of the parameters, [parameters x parameters]");

    py::class_<Sensitivity> sensitivity(module, "Sensitivity", "What a sensitivity study gives.");
    bind_tables(sensitivity);
}

}  // namespace
}  // namespace crampfit

PYBIND11_MODULE(crampfit, module) {
    using namespace crampfit;
    module.doc() = "Couples crack-growth simulations of wood to experiments; functions are named as the command's verbs.";
    module.attr("__version__") = CRAMPFIT_VERSION;
    py::register_exception<InputError>(module, "InputError", PyExc_ValueError).doc() =
        "Bad input: file, key, value and the rule that it breaks.";
    bind_results(module);
    const py::arg_v set("set", py::dict(), "{}");
    const py::arg_v threads("threads", 0, "0");
    const py::arg_v keep("keep", py::none(), "None");
    const py::arg_v resume("resume", false, "False");
    module.def("simulate", &run_scene, py::arg("scene"), set, threads,
               "Runs a scene. `set` overrides keys, as --set does: texts such as \"50 MPa\", or numbers, truth values, lists and "
               "dicts. `threads`: 0 for one a core.");
    module.def(
        "explain", [](const Path& scene, const py::dict& settings) { return explain(open_scene(scene, settings)); },
        py::arg("scene"), set, "What will be modelled, by which solver, why, and what it will cost.");
    module.def("fit", &run_fit, py::arg("study"), set, threads, keep, resume,
               "Adjusts parameters until the simulations match the experiments. `keep`: a file for the runs as they end; "
               "`resume`: go on from those that are there.");
    module.def("sensitivity", &run_sensitivity, py::arg("study"), set, threads, keep, resume,
               "Local, Morris and Sobol sensitivity of the chosen outputs.");
    module.def("evaluate", &run_evaluation, py::arg("study"), py::arg("values") = std::map<std::string, double>(), set, threads,
               py::arg("gradient") = false,
               "The study's outputs, or else its residuals, with these values of the parameters in their units, by name; with "
               "`gradient` "
               "also their derivatives [results x parameters].");
    module.def("load", &load, py::arg("file"), "A record, a fit or a sensitivity study from its HDF5 file.");
}
