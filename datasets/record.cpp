#include "datasets/record.hpp"

#include <stdexcept>

namespace crampfit {

const char* name(RunStatus status) {
    switch (status) {
    case RunStatus::finished:
        return "finished";
    case RunStatus::split:
        return "split";
    case RunStatus::interrupted:
        return "interrupted";
    case RunStatus::unstable:
        return "unstable";
    }
    throw std::logic_error("a run status without a name");
}

}  // namespace crampfit
