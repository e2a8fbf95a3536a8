#include "datasets/fit.hpp"

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

}  // namespace crampfit
