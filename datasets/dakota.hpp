#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

namespace crampfit {

/// One evaluation that Dakota asks for: a parameters file in its standard or its APREPRO format (Dakota 6.19 User's Manual,
/// "Parameters file format").
struct DakotaRequest {
    enum Active { value = 1, gradient = 2, hessian = 4 };

    std::vector<std::pair<std::string, std::string>> variables;  // label, and value as written
    std::vector<int> active;                                     // [functions] what is asked for: a sum of Active
    std::vector<std::string> labels;                             // [functions]
    std::vector<std::size_t> derivative_variables;               // numbers of variables from 0
};

/// Throws InputError for a file that is neither, and for metadata, of which there is none to give.
DakotaRequest read_dakota_request(const std::filesystem::path& file);

/// Which of the outputs with these names each function is [functions]: by its label, in which _ stands for a space, each once; or
/// one after the other where labels are left out or end with their own number, as f1 and Dakota's response_fn_1. Throws
/// InputError for other labels; there must be as many functions as names.
std::vector<std::size_t> outputs_asked_for(const DakotaRequest& request, const std::vector<std::string>& names,
                                           const std::filesystem::path& file);

/// What was asked for: values [functions], gradients [functions][derivative variables]. Written as a whole.
void write_dakota_results(const DakotaRequest& request, const std::vector<double>& values,
                          const std::vector<std::vector<double>>& gradients, const std::filesystem::path& file);

/// Whether a file may be written as an answer before it is known what else is read: it is not there, or looks like one.
bool may_hold_dakota_answer(const std::filesystem::path& file);

/// Tells Dakota that the evaluation failed, for its failure capturing.
void write_dakota_failure(const std::string& reason, const std::filesystem::path& file);

}  // namespace crampfit
