#include "datasets/fit.hpp"

#include <algorithm>
#include <stdexcept>

namespace crampfit {

const char* name(FitStatus status) {
    switch (status) {
    case FitStatus::converged:
        return "converged";
    case FitStatus::run_limit:
        return "run limit";
    case FitStatus::interrupted:
        return "interrupted";
    case FitStatus::failed:
        return "failed";
    }
    throw std::logic_error("a fit status without a name");
}

SimulatedPath together(const Fit& fit, const std::string& model) {
    SimulatedPath all{.model = model, .status = "", .cracks = {}};
    double sum = 0, largest = 0;
    for (const CrackPaths& paths : fit.crack_paths)
        for (const SimulatedPath& one : paths.simulated)
            if (one.model == model && one.compared_length > 0) {
                sum += one.compared_length * one.mean_distance;
                largest = std::max(largest, one.largest_distance);
                all.compared_length += one.compared_length;
            }
    if (all.compared_length > 0) {
        all.mean_distance = sum / all.compared_length;
        all.largest_distance = largest;
    }
    return all;
}

std::vector<std::string> sentences(const std::string& message) {
    const std::string end = ". ";
    std::vector<std::string> found;
    for (std::size_t from = 0; from < message.size();) {
        const std::size_t next = std::min(message.find(end, from), message.size() - 1) + 1;  // behind the full stop
        found.push_back(message.substr(from, next - from));
        from = next + 1;
    }
    return found;
}

}  // namespace crampfit
