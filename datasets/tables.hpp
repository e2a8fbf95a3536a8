#pragma once

#include "datasets/fit.hpp"
#include "datasets/record.hpp"
#include "datasets/sensitivity.hpp"

#include <iosfwd>
#include <string>
#include <vector>

namespace crampfit {

/// Names of the tables of a result.
std::vector<std::string> table_names(const Record& record);
std::vector<std::string> table_names(const Fit& fit);
std::vector<std::string> table_names(const Sensitivity& sensitivity);

/// Prints one of them as CSV. Throws InputError for an unknown name.
void print_table(const Record& record, const std::string& table, std::ostream& out);
void print_table(const Fit& fit, const std::string& table, std::ostream& out);
void print_table(const Sensitivity& sensitivity, const std::string& table, std::ostream& out);

}  // namespace crampfit
