#include "inverse/minimize.hpp"

#include <nlopt.h>

#include <algorithm>
#include <exception>
#include <map>
#include <memory>

namespace crampfit {
namespace {

constexpr double initial_step = 0.15;  // of the box
constexpr double x_tolerance = 1e-5;   // of the box
constexpr double f_tolerance = 1e-9;   // of the misfit

const std::map<std::string, nlopt_algorithm>& algorithms() {
    static const std::map<std::string, nlopt_algorithm> table = {
        {"bobyqa", NLOPT_LN_BOBYQA},         {"sbplx", NLOPT_LN_SBPLX},  {"cobyla", NLOPT_LN_COBYLA},
        {"neldermead", NLOPT_LN_NELDERMEAD}, {"crs2", NLOPT_GN_CRS2_LM}, {"isres", NLOPT_GN_ISRES},
        {"direct", NLOPT_GN_DIRECT_L},       {"mlsl", NLOPT_G_MLSL_LDS},
    };
    return table;
}

struct Freed {
    void operator()(nlopt_opt optimizer) const { nlopt_destroy(optimizer); }
};
using Optimizer = std::unique_ptr<std::remove_pointer_t<nlopt_opt>, Freed>;

/// What the callback needs. Nothing is thrown through NLopt, which would take any exception for a forced stop.
struct Search {
    Objective& objective;
    nlopt_opt optimizer;
    bool builds_models;  // of the misfit, rather than only comparing values
    double worst = 0;    // largest finite misfit seen
    std::exception_ptr thrown;

    // Stands for a run that failed. A quadratic model would be lost with a huge number; a comparison is safe only with
    // one, as a later run that ends well may be worse than any before.
    double penalty() const { return builds_models && worst > 0 ? 2 * worst : 1e30; }
};

double misfit(unsigned n, const double* x, double*, void* data) {
    Search& search = *static_cast<Search*>(data);
    try {
        const Eigen::VectorXd point = Eigen::Map<const Eigen::VectorXd>(x, n).cwiseMax(0.0).cwiseMin(1.0);
        const auto here = search.objective.at(point);
        if (here && here->usable()) {
            search.worst = std::max(search.worst, here->misfit);
            return here->misfit;
        }
        if (!here) {
            nlopt_force_stop(search.optimizer);
        }
    } catch (...) {  // an exception must not cross the C library: kept, and thrown again after it returns
        search.thrown = std::current_exception();
        nlopt_force_stop(search.optimizer);
    }
    return search.penalty();
}

// A local method ends by its tolerances. A global one would take two good points that happen to be alike for an end.
Optimizer make(nlopt_algorithm algorithm, unsigned n, bool global) {
    Optimizer optimizer(nlopt_create(algorithm, n));
    nlopt_set_lower_bounds1(optimizer.get(), 0.0);
    nlopt_set_upper_bounds1(optimizer.get(), 1.0);
    nlopt_set_initial_step1(optimizer.get(), initial_step);
    if (!global) {
        nlopt_set_xtol_abs1(optimizer.get(), x_tolerance);
        nlopt_set_ftol_rel(optimizer.get(), f_tolerance);
    }
    return optimizer;
}

std::string words(nlopt_result result) {
    const char* text = nlopt_result_to_string(result);
    return text ? text : "unknown result " + std::to_string(static_cast<int>(result));
}

}  // namespace

Solution minimize_with_nlopt(Objective& objective, const Eigen::VectorXd& start, const Method& method) {
    const auto n = static_cast<unsigned>(objective.parameters());
    const nlopt_algorithm algorithm = algorithms().at(method.name);
    const Optimizer optimizer = make(algorithm, n, is_global(method));
    const Optimizer local = make(NLOPT_LN_SBPLX, n, false);  // which failed runs do not mislead
    if (algorithm == NLOPT_G_MLSL_LDS) {
        nlopt_set_local_optimizer(optimizer.get(), local.get());
    }
    const bool builds_models = method.name == "bobyqa" || method.name == "cobyla";
    Search search{objective, optimizer.get(), builds_models, 0.0, {}};
    nlopt_set_min_objective(optimizer.get(), misfit, &search);
    // Runs are counted by the objective. Points that it already knows are free, and a method could ask for them for
    // ever.
    nlopt_set_maxeval(optimizer.get(), 1000 + 10 * objective.budget_left());
    nlopt_srand(method.seed);
    Eigen::VectorXd x = start;
    double value = 0;
    const nlopt_result result = nlopt_optimize(optimizer.get(), x.data(), &value);
    if (search.thrown) {
        std::rethrow_exception(search.thrown);
    }
    const bool converged = (result > 0 && result != NLOPT_MAXEVAL_REACHED) || result == NLOPT_ROUNDOFF_LIMITED;
    return {converged && !objective.exhausted(), words(result)};
}

}  // namespace crampfit
