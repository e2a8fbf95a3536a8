#include "cli/study_verb.hpp"
#include "cli/verbs.hpp"
#include "datasets/dakota.hpp"
#include "datasets/error.hpp"
#include "inverse/fit.hpp"
#include "inverse/sensitivity.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <memory>
#include <numeric>
#include <optional>

namespace crampfit::cli {

namespace {

struct EvaluateArguments {
    std::filesystem::path study;
    std::filesystem::path parameters;
    std::filesystem::path results;
};

/// Labels have no spaces: a parameter goes by its name with _ in their place, or by a key.
bool is_called(const Parameter& parameter, const std::string& label) {
    std::string name = parameter.name;
    std::replace(name.begin(), name.end(), ' ', '_');
    return label == name || std::find(parameter.keys.begin(), parameter.keys.end(), label) != parameter.keys.end();
}

double number_of(const std::pair<std::string, std::string>& variable, const std::string& file) {
    double number = 0;
    const std::string& text = variable.second;
    const char* const end = text.data() + text.size();
    const auto [rest, error] = std::from_chars(text.data() + (text.starts_with('+') ? 1 : 0), end, number);
    if (error != std::errc() || rest != end || !std::isfinite(number))
        throw InputError(file, variable.first, text, "must be a finite number");
    return number;
}

/// What Dakota wants to know of, in the study's terms.
struct Point {
    Eigen::VectorXd values;               // [parameters] SI
    std::vector<std::size_t> parameters;  // [variables] which each is
};

Point point_of(const DakotaRequest& request, const Study& study, const std::string& file) {
    const std::vector<Parameter>& all = study.parameters;
    Point point{Eigen::VectorXd::Constant(static_cast<Eigen::Index>(all.size()), std::nan("")), {}};
    for (const auto& variable : request.variables) {
        const auto found = std::find_if(all.begin(), all.end(), [&](const Parameter& p) { return is_called(p, variable.first); });
        if (found == all.end())
            throw InputError(file, variable.first, variable.second,
                             "is no parameter of the study: name it as the study does, with _ for each space, or by its key");
        point.parameters.push_back(static_cast<std::size_t>(found - all.begin()));
        double& value = point.values[static_cast<Eigen::Index>(point.parameters.back())];
        if (!std::isnan(value))
            throw InputError(file, variable.first, variable.second, "is the same parameter as another variable");
        value = number_of(variable, file) * found->unit_factor;
    }
    for (std::size_t j = 0; j < all.size(); ++j)
        if (std::isnan(point.values[static_cast<Eigen::Index>(j)]))
            throw InputError(file, "variables", "", fmt::format("lacks the study's parameter \"{}\"", all[j].name));
    return point;
}

bool asks_for(const DakotaRequest& request, DakotaRequest::Active what) {
    return std::any_of(request.active.begin(), request.active.end(), [&](int active) { return (active & what) != 0; });
}

/// Why there is nothing to write; empty: it was written.
std::string evaluate(const Study& study, const DakotaRequest& request, const Point& point, const CommonOptions& common,
                     const std::filesystem::path& parameters, const std::filesystem::path& results) {
    const bool of_outputs = !study.outputs.empty();
    if (asks_for(request, DakotaRequest::hessian)) return "Hessians were asked for, and there are none";
    const bool misfit = !of_outputs && request.active.size() == 1;
    const std::vector<std::string> names = of_outputs ? output_names(study) : std::vector<std::string>{};
    const std::size_t count = of_outputs ? names.size() : residual_count(study);
    if (!misfit && count != request.active.size())
        throw InputError(study.file.string(), of_outputs ? "outputs" : "residuals", std::to_string(count),
                         fmt::format("must be as many as the functions that are asked for, which are {}{}", request.active.size(),
                                     of_outputs ? "" : "; or ask for one, the sum of their squares"));
    std::vector<std::size_t> order(request.active.size());  // of the study's outputs or residuals, as functions are
    std::iota(order.begin(), order.end(), 0);
    if (of_outputs) order = outputs_asked_for(request, names, parameters);
    const StudyFunction function =
        of_outputs ? output_function(study, &stop_requested()) : fit_function(study, &stop_requested());
    const Evaluation evaluation = function(point.values, common.threads);
    if (!evaluation.usable()) return evaluation.status;
    Eigen::VectorXd values = misfit ? evaluation.residuals : Eigen::VectorXd(evaluation.residuals(order));
    Eigen::MatrixXd slopes;  // [functions x parameters]
    if (asks_for(request, DakotaRequest::gradient)) {
        const auto found = of_outputs ? output_slopes(study, point.values, &stop_requested())
                                      : fit_slopes(study, point.values, &stop_requested());
        if (!found) return "gradients were asked for, and the solver has none that hold for this study: see crampfit explain";
        slopes = misfit ? Eigen::MatrixXd(2.0 * values.transpose() * *found) : Eigen::MatrixXd((*found)(order, Eigen::all));
    }
    if (misfit) values = Eigen::VectorXd::Constant(1, evaluation.misfit);
    for (std::size_t k = 0; k < request.active.size(); ++k) {
        const auto row = static_cast<Eigen::Index>(k);
        if ((request.active[k] & DakotaRequest::value && !std::isfinite(values[row])) ||
            (request.active[k] & DakotaRequest::gradient && !slopes.row(row).allFinite()))
            return fmt::format("the run has no output for function {}", k + 1);
    }
    std::vector<std::vector<double>> gradients(request.active.size());
    for (std::size_t k = 0; k < gradients.size() && slopes.size() > 0; ++k)
        for (const std::size_t variable : request.derivative_variables) {
            const std::size_t j = point.parameters[variable];
            gradients[k].push_back(slopes(static_cast<Eigen::Index>(k), static_cast<Eigen::Index>(j)) *
                                   study.parameters[j].unit_factor);
        }
    write_dakota_results(request, {values.begin(), values.end()}, gradients, results);
    return "";
}

ExitStatus evaluate_and_save(const EvaluateArguments& arguments, const CommonOptions& common) {
    check_output(arguments.results, {arguments.study, arguments.parameters});
    std::string failure;
    bool is_ours = may_hold_dakota_answer(arguments.results);
    try {
        const Study study = open_study(arguments.study, common);
        is_ours = false;
        check_output(arguments.results, files_of(study));
        is_ours = true;
        const DakotaRequest request = read_dakota_request(arguments.parameters);
        failure = evaluate(study, request, point_of(request, study, arguments.parameters.string()), common, arguments.parameters,
                           arguments.results);
    } catch (const InputError& error) {  // no answer to an earlier question stays
        if (is_ours) write_dakota_failure(error.what(), arguments.results);
        throw;
    }
    if (failure.empty()) return ExitStatus::done;
    write_dakota_failure(failure, arguments.results);
    report(common, "failed: " + failure);
    return stop_requested() ? ExitStatus::interrupted : ExitStatus::incomplete;
}

}  // namespace

Verb evaluate_verb(CLI::App& command, const CommonOptions& common) {
    auto arguments = std::make_shared<EvaluateArguments>();
    CLI::App* verb =
        command.add_subcommand("evaluate", "Evaluate a study once, for Dakota: its parameters file in, its results file out");
    verb->add_option("study", arguments->study, "The study")->type_name("STUDY.toml")->required();
    verb->add_option("parameters", arguments->parameters, "What Dakota asks for, in its standard or its APREPRO format")
        ->type_name("PARAMS.in")
        ->required();
    verb->add_option("results", arguments->results, "Where the answer goes")->type_name("RESULTS.out")->required();
    return {verb, [arguments, &common] { return evaluate_and_save(*arguments, common); }};
}

}  // namespace crampfit::cli
