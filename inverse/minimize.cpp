#include "inverse/minimize.hpp"

namespace crampfit {

const std::vector<std::string>& method_names() {
    static const std::vector<std::string> names = {"auto",       "ceres", "bobyqa", "sbplx",  "cobyla",
                                                   "neldermead", "crs2",  "isres",  "direct", "mlsl"};
    return names;
}

bool is_global(const Method& method) {
    return method.name == "crs2" || method.name == "isres" || method.name == "direct" || method.name == "mlsl";
}

Solution minimize(Objective& objective, const Eigen::VectorXd& start, const Method& method) {
    if (method.name == "auto") {
        return minimize_on_models(objective, start);
    }
    return method.name == "ceres" ? minimize_with_ceres(objective, start) : minimize_with_nlopt(objective, start, method);
}

}  // namespace crampfit
