#include "datasets/crack_paths_file.hpp"
#include "datasets/hdf5.hpp"
#include "datasets/io.hpp"

#include <limits>

namespace crampfit {

using hdf5::Group;

namespace {

using RowMajorMatrix = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

struct TextColumn {
    const char* name;
    std::string FittedParameter::*value;
    const char* description;
};
struct NumberColumn {
    const char* name;
    double FittedParameter::*value;
    const char* description;
};

constexpr TextColumn parameter_texts[] = {
    {"name", &FittedParameter::name, "name in the study"},
    {"key", &FittedParameter::key, "keys of the scenes, with a space between"},
    {"unit", &FittedParameter::unit, "unit of this parameter's numbers; empty for a pure number"},
};
constexpr NumberColumn parameter_numbers[] = {
    {"value", &FittedParameter::value, "best value"},
    {"standard_error", &FittedParameter::standard_error, "standard error"},
    {"lower_95", &FittedParameter::lower_95, "lower end of the 95 % interval"},
    {"upper_95", &FittedParameter::upper_95, "upper end of the 95 % interval"},
    {"initial", &FittedParameter::initial, "where the search began"},
};

const char* const parameter_units = "of parameters/unit";
const char* const residual_units = "m for displacement and crack length, N for force, s for time";

/// Copies one member of every row into a column of its own.
template <class Row, class Value>
std::vector<Value> column_of(const std::vector<Row>& rows, Value Row::*member) {
    std::vector<Value> column;
    for (const Row& row : rows) column.push_back(row.*member);
    return column;
}

template <class Row, class Value>
void fill_column(std::vector<Row>& rows, Value Row::*member, const std::vector<Value>& column) {
    for (std::size_t i = 0; i < rows.size(); ++i) rows[i].*member = column[i];
}

// ---- parameters

void write_parameters(Group& root, const std::vector<FittedParameter>& parameters) {
    Group group = root.make_group("parameters", "what was fitted; the table `parameters`");
    for (const TextColumn& column : parameter_texts)
        group.write_texts(column.name, column_of(parameters, column.value), column.description);
    for (const NumberColumn& column : parameter_numbers)
        group.write(column.name, column_of(parameters, column.value), {parameter_units, column.description});
    std::vector<std::uint8_t> at_bound;
    for (const FittedParameter& parameter : parameters) at_bound.push_back(parameter.at_bound);
    group.write("at_bound", at_bound, {"1", "1 where the best value lies at a bound, 0 elsewhere"});
}

std::vector<FittedParameter> read_parameters(const Group& group) {
    std::vector<FittedParameter> parameters(group.read_texts("name").size());
    for (const TextColumn& column : parameter_texts)
        fill_column(parameters, column.value, group.read_texts(column.name, parameters.size()));
    for (const NumberColumn& column : parameter_numbers)
        fill_column(parameters, column.value, group.read_column<double>(column.name, parameters.size()));
    const std::vector<std::uint8_t> at_bound = group.read_column<std::uint8_t>("at_bound", parameters.size());
    for (std::size_t i = 0; i < parameters.size(); ++i) parameters[i].at_bound = at_bound[i] != 0;
    return parameters;
}

// ---- matrices: empty when there is no estimate

void write_matrix(Group& root, const char* matrix_name, const Eigen::MatrixXd& matrix, const hdf5::Meaning& meaning) {
    const RowMajorMatrix rows = matrix;
    root.write(matrix_name, std::vector<double>(rows.data(), rows.data() + rows.size()),
               {static_cast<std::size_t>(rows.rows()), static_cast<std::size_t>(rows.cols())}, meaning);
}

Eigen::MatrixXd read_matrix(const Group& root, const char* matrix_name, std::size_t parameters) {
    const auto array = root.read<double>(matrix_name, {std::nullopt, std::nullopt});
    if (array.shape != hdf5::Shape{0, 0} && array.shape != hdf5::Shape{parameters, parameters})
        root.refuse(matrix_name, std::to_string(array.shape[0]) + " x " + std::to_string(array.shape[1]),
                    "must have a row and a column for each parameter, or be empty");
    return Eigen::Map<const RowMajorMatrix>(array.values.data(), static_cast<Eigen::Index>(array.shape[0]),
                                            static_cast<Eigen::Index>(array.shape[1]));
}

// ---- runs and residuals

void write_runs(Group& root, const std::vector<FitRun>& runs, std::size_t parameters) {
    Group group = root.make_group("runs", "every forward run of the fit; the table `runs`");
    std::vector<double> values;
    for (const FitRun& run : runs) values.insert(values.end(), run.parameters.begin(), run.parameters.end());
    group.write("parameters", values, {runs.size(), parameters}, {parameter_units, "a row a run, a column a parameter"});
    group.write("misfit", column_of(runs, &FitRun::misfit),
                {"1", "sum of squared weighted residuals; infinite when the run failed"});
    group.write_texts("status", column_of(runs, &FitRun::status), "how the run ended");
    group.write("seconds", column_of(runs, &FitRun::seconds), {"s", "wall time of the run"});
}

std::vector<FitRun> read_runs(const Group& group, std::size_t parameters) {
    const auto [shape, values] = group.read<double>("parameters", {std::nullopt, parameters});
    std::vector<FitRun> runs(shape.front());
    for (std::size_t i = 0; i < runs.size(); ++i) {
        const double* first = values.data() + i * parameters;
        runs[i].parameters.assign(first, first + parameters);
    }
    fill_column(runs, &FitRun::misfit, group.read_column<double>("misfit", runs.size()));
    fill_column(runs, &FitRun::status, group.read_texts("status", runs.size()));
    fill_column(runs, &FitRun::seconds, group.read_column<double>("seconds", runs.size()));
    return runs;
}

struct ResidualColumn {
    const char* name;
    double FitResidual::*value;
    const char* units;
    const char* description;
};

constexpr ResidualColumn residual_numbers[] = {
    {"at", &FitResidual::at, "m", "displacement for a force, crack length for an arrival"},
    {"measured", &FitResidual::measured, residual_units, "what the test gave"},
    {"modelled", &FitResidual::modelled, residual_units, "what the model gives at the best parameters"},
    {"sigma", &FitResidual::sigma, residual_units, "standard deviation of the measurement"},
    {"residual", &FitResidual::residual, "1", "(modelled - measured) / sigma"},
};

struct CheckColumn {
    const char* name;
    double FitCheck::*value;
    const char* description;
};

constexpr CheckColumn check_numbers[] = {
    {"chi_square", &FitCheck::chi_square, "sum of squared residuals"},
    {"p_chi_square", &FitCheck::p_chi_square, "how often noise alone makes it as large"},
    {"autocorrelation", &FitCheck::autocorrelation, "of neighbouring residuals"},
    {"p_autocorrelation", &FitCheck::p_autocorrelation, "how often white noise makes it as large"},
};

void write_residuals(Group& root, const std::vector<FitResidual>& residuals) {
    Group group = root.make_group("residuals", "data against model; the table `residuals`");
    group.write_texts("experiment", column_of(residuals, &FitResidual::experiment), "name of the experiment");
    group.write_texts("kind", column_of(residuals, &FitResidual::kind), "force, arrival, or u_x or u_y of a displacement field");
    for (const ResidualColumn& column : residual_numbers)
        group.write(column.name, column_of(residuals, column.value), {column.units, column.description});
}

std::vector<FitResidual> read_residuals(const Group& group) {
    std::vector<FitResidual> residuals(group.read_texts("experiment").size());
    fill_column(residuals, &FitResidual::experiment, group.read_texts("experiment", residuals.size()));
    fill_column(residuals, &FitResidual::kind, group.read_texts("kind", residuals.size()));
    for (const ResidualColumn& column : residual_numbers)
        fill_column(residuals, column.value, group.read_column<double>(column.name, residuals.size()));
    return residuals;
}

// ---- checks, profile and posterior

void write_checks(Group& root, const std::vector<FitCheck>& checks) {
    Group group = root.make_group("checks", "whether what is left of each curve looks like noise; the table `checks`");
    group.write_texts("experiment", column_of(checks, &FitCheck::experiment), "name of the experiment");
    group.write_texts("kind", column_of(checks, &FitCheck::kind), "force, arrival, or u_x or u_y of a displacement field");
    std::vector<std::int64_t> points;
    for (const FitCheck& check : checks) points.push_back(check.points);
    group.write("points", points, {"1", "points compared"});
    for (const CheckColumn& column : check_numbers)
        group.write(column.name, column_of(checks, column.value), {"1", column.description});
}

std::vector<FitCheck> read_checks(const Group& group) {
    std::vector<FitCheck> checks(group.read_texts("experiment").size());
    fill_column(checks, &FitCheck::experiment, group.read_texts("experiment", checks.size()));
    fill_column(checks, &FitCheck::kind, group.read_texts("kind", checks.size()));
    const auto points = group.read_column<std::int64_t>("points", checks.size());
    for (std::size_t i = 0; i < checks.size(); ++i) checks[i].points = static_cast<int>(points[i]);
    for (const CheckColumn& column : check_numbers)
        fill_column(checks, column.value, group.read_column<double>(column.name, checks.size()));
    return checks;
}

struct DistanceColumn {
    const char* name;
    double CurveDistance::*value;
    const char* units;
    const char* description;
};

const char* const area_units = "J for force over displacement, m^2 for arrival over crack length, N s for force over time";

constexpr DistanceColumn distance_numbers[] = {
    {"area_measured", &CurveDistance::area_measured, area_units, "under the measured curve"},
    {"area_modelled", &CurveDistance::area_modelled, area_units, "under the modelled curve"},
    {"area_between", &CurveDistance::area_between, area_units, "between both"},
    {"frechet", &CurveDistance::frechet, "1", "Frechet distance of both, axes divided by the measured range"},
};

void write_distances(Group& root, const std::vector<CurveDistance>& distances) {
    Group group = root.make_group("distances", "how far the curves are apart; the table `distances`");
    group.write_texts("experiment", column_of(distances, &CurveDistance::experiment), "name of the experiment");
    group.write_texts("kind", column_of(distances, &CurveDistance::kind), "force or arrival");
    for (const DistanceColumn& column : distance_numbers)
        group.write(column.name, column_of(distances, column.value), {column.units, column.description});
}

std::vector<CurveDistance> read_distances(const Group& group) {
    std::vector<CurveDistance> distances(group.read_texts("experiment").size());
    fill_column(distances, &CurveDistance::experiment, group.read_texts("experiment", distances.size()));
    fill_column(distances, &CurveDistance::kind, group.read_texts("kind", distances.size()));
    for (const DistanceColumn& column : distance_numbers)
        fill_column(distances, column.value, group.read_column<double>(column.name, distances.size()));
    return distances;
}

struct ModelColumn {
    const char* name;
    double ComparedModel::*value;
    const char* description;
};

constexpr ModelColumn model_numbers[] = {
    {"misfit", &ComparedModel::misfit, "sum of squared weighted residuals; infinite when no run ended well"},
    {"aic", &ComparedModel::aic, "Akaike's information criterion"},
    {"bic", &ComparedModel::bic, "Bayesian information criterion"},
    {"weight", &ComparedModel::weight, "Akaike weight"},
};

void write_models(Group& root, const std::vector<ComparedModel>& models, std::size_t parameters) {
    Group group = root.make_group("models", "models that were compared, best first; the table `models`");
    group.write_texts("name", column_of(models, &ComparedModel::name), "value of the key that tells them apart");
    group.write_texts("status", column_of(models, &ComparedModel::status), "how its fit ended");
    for (const ModelColumn& column : model_numbers)
        group.write(column.name, column_of(models, column.value), {"1", column.description});
    std::vector<double> values;
    for (const ComparedModel& model : models) values.insert(values.end(), model.values.begin(), model.values.end());
    group.write("parameters", values, {models.size(), parameters}, {parameter_units, "a row a model, a column a parameter"});
}

std::vector<ComparedModel> read_models(const Group& group, std::size_t parameters) {
    const auto [shape, values] = group.read<double>("parameters", {std::nullopt, parameters});
    std::vector<ComparedModel> models(shape.front());
    for (std::size_t i = 0; i < models.size(); ++i) {
        const double* first = values.data() + i * parameters;
        models[i].values.assign(first, first + parameters);
    }
    fill_column(models, &ComparedModel::name, group.read_texts("name", models.size()));
    fill_column(models, &ComparedModel::status, group.read_texts("status", models.size()));
    for (const ModelColumn& column : model_numbers)
        fill_column(models, column.value, group.read_column<double>(column.name, models.size()));
    return models;
}

void write_profile(Group& root, const std::vector<ProfilePoint>& profile) {
    Group group = root.make_group("profile", "least misfit with one parameter held; the table `profile`");
    group.write_texts("parameter", column_of(profile, &ProfilePoint::parameter), "the one that is held");
    group.write("value", column_of(profile, &ProfilePoint::value), {parameter_units, "where it is held"});
    group.write("misfit", column_of(profile, &ProfilePoint::misfit), {"1", "least sum of squared weighted residuals"});
}

std::vector<ProfilePoint> read_profile(const Group& group) {
    std::vector<ProfilePoint> profile(group.read_texts("parameter").size());
    fill_column(profile, &ProfilePoint::parameter, group.read_texts("parameter", profile.size()));
    fill_column(profile, &ProfilePoint::value, group.read_column<double>("value", profile.size()));
    fill_column(profile, &ProfilePoint::misfit, group.read_column<double>("misfit", profile.size()));
    return profile;
}

void write_posterior(Group& root, const std::vector<PosteriorSample>& samples, std::size_t parameters) {
    Group group = root.make_group("posterior", "samples of the posterior; the table `posterior`");
    std::vector<double> values;
    for (const PosteriorSample& sample : samples) values.insert(values.end(), sample.parameters.begin(), sample.parameters.end());
    group.write("parameters", values, {samples.size(), parameters}, {parameter_units, "a row a sample, a column a parameter"});
    group.write("misfit", column_of(samples, &PosteriorSample::misfit), {"1", "sum of squared weighted residuals"});
}

std::vector<PosteriorSample> read_posterior(const Group& group, std::size_t parameters) {
    const auto [shape, values] = group.read<double>("parameters", {std::nullopt, parameters});
    std::vector<PosteriorSample> samples(shape.front());
    for (std::size_t i = 0; i < samples.size(); ++i) {
        const double* first = values.data() + i * parameters;
        samples[i].parameters.assign(first, first + parameters);
    }
    fill_column(samples, &PosteriorSample::misfit, group.read_column<double>("misfit", samples.size()));
    return samples;
}

FitStatus read_status(const Group& root) {
    const std::string text = root.read_text("status");
    for (const FitStatus status : {FitStatus::converged, FitStatus::run_limit, FitStatus::interrupted, FitStatus::failed})
        if (text == name(status)) return status;
    root.refuse("status", text, "must be converged, run limit, interrupted or failed");
}

unsigned read_seed(const Group& root) {
    const std::int64_t seed = root.read_number<std::int64_t>("seed");
    if (seed < 0 || seed > std::numeric_limits<unsigned>::max())
        root.refuse("seed", std::to_string(seed), "must fit into 32 bits without sign");
    return static_cast<unsigned>(seed);
}

}  // namespace

void write(const Fit& fit, const std::filesystem::path& file) {
    hdf5::save(file, "fit", [&](Group& root) {
        root.write_text("status", name(fit.status), "how the fit ended");
        root.write_text("message", fit.message, "why the fit ended");
        root.write_text("method", fit.method, "what did the work, and why it was chosen");
        root.write_text("study_text", fit.study_text, "the study in TOML as it was used");
        root.write_text("scene_settings", fit.scene_settings, "what --set changed in the scenes");
        root.write<std::int64_t>("seed", fit.seed, {"1", "of everything that was drawn at random"});
        root.write("misfit", fit.misfit, {"1", "sum of squared weighted residuals at the best parameters"});
        root.write("reduced_chi_square", fit.reduced_chi_square, {"1", "misfit for each degree of freedom"});
        root.write("seconds", fit.seconds, {"s", "wall time of the fit"});
        write_parameters(root, fit.parameters);
        write_matrix(root, "covariance", fit.covariance,
                     {"products of parameters/unit", "covariance of the parameters, in their order"});
        write_matrix(root, "correlation", fit.correlation, {"1", "correlation of the parameters, in their order"});
        write_runs(root, fit.runs, fit.parameters.size());
        write_residuals(root, fit.residuals);
        write_checks(root, fit.checks);
        write_distances(root, fit.distances);
        write_models(root, fit.models, fit.parameters.size());
        write_crack_paths(root, fit.crack_paths);
        write_profile(root, fit.profile);
        write_posterior(root, fit.posterior, fit.parameters.size());
    });
}

Fit read_fit(const std::filesystem::path& file) {
    const Group root = hdf5::open(file, "fit");
    Fit fit;
    fit.status = read_status(root);
    fit.message = root.read_text("message");
    fit.method = root.read_text("method");
    fit.study_text = root.read_text("study_text");
    if (root.has("scene_settings")) fit.scene_settings = root.read_text("scene_settings");
    fit.seed = read_seed(root);
    fit.misfit = root.read_number<double>("misfit");
    fit.reduced_chi_square = root.read_number<double>("reduced_chi_square");
    fit.seconds = root.read_number<double>("seconds");
    fit.parameters = read_parameters(root.group("parameters"));
    fit.covariance = read_matrix(root, "covariance", fit.parameters.size());
    fit.correlation = read_matrix(root, "correlation", fit.parameters.size());
    fit.runs = read_runs(root.group("runs"), fit.parameters.size());
    fit.residuals = read_residuals(root.group("residuals"));
    fit.checks = read_checks(root.group("checks"));
    fit.distances = read_distances(root.group("distances"));
    fit.models = read_models(root.group("models"), fit.parameters.size());
    if (root.has("crack paths")) fit.crack_paths = read_crack_paths(root);
    fit.profile = read_profile(root.group("profile"));
    fit.posterior = read_posterior(root.group("posterior"), fit.parameters.size());
    return fit;
}

}  // namespace crampfit
