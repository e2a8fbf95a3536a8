#include "datasets/error.hpp"
#include "datasets/machine.hpp"
#include "datasets/numbers.hpp"
#include "datasets/study_parts.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace crampfit {
namespace {

/// The rule of the number that `key` leads to: of an experiment's machine, or in at least one of the scenes.
NumberRule find_rule(const Entry& entry, const std::string& key, const Study& study) {
    std::string reason;
    try {
        if (const auto found = find_machine_number(study, key, "", "")) {
            return found->number->rule;
        }
    } catch (const InputError& error) {
        entry.fail(fmt::format("{} {}", key, error.rule));
    }
    for (const Scene* scene : scenes_of(study)) {
        try {
            return find_number(*scene, key, "", "").rule;
        } catch (const InputError& error) {
            reason = error.rule;
        }
    }
    entry.fail(fmt::format("{} {}", key, reason));
}

bool share_one(const std::vector<const double*>& one, const std::vector<const double*>& other) {
    return std::ranges::find_first_of(one, other) != one.end();
}

std::vector<Entry> key_entries(const Entry& parameter) {
    if (parameter.has("key") == parameter.has("keys")) {
        parameter.fail("give one of key and keys");
    }
    if (parameter.has("key")) {
        return {parameter.at("key")};
    }
    const std::vector<Entry> entries = parameter.at("keys").list();
    if (entries.empty()) {
        parameter.at("keys").fail("at least one key is needed");
    }
    return entries;
}

/// Fills in the keys and returns the rule of each.
std::vector<NumberRule> read_keys(const Entry& entry, const Study& study, Parameter& parameter) {
    std::vector<NumberRule> rules;
    for (const Entry& key : key_entries(entry)) {
        rules.push_back(find_rule(key, key.text(), study));
        if (!(rules.back().dimension == rules.front().dimension)) {
            key.fail(fmt::format("all keys of a parameter need one dimension: got {} after {}", describe(rules.back().dimension),
                                 describe(rules.front().dimension)));
        }
        for (const std::string& before : parameter.keys) {
            if (share_one(numbers_at(study, before), numbers_at(study, key.text()))) {
                key.fail(before == key.text() ? "is given twice" : fmt::format("is the same number as {}", before));
            }
        }
        parameter.keys.push_back(key.text());
    }
    return rules;
}

/// Fixed ratios: each key is its factor times the parameter's value.
std::vector<double> read_factors(const Entry& parameter, std::size_t keys) {
    std::vector<double> factors;
    if (const auto entry = parameter.find("factors")) {
        for (const Entry& factor : entry->list()) {
            factors.push_back(factor.number(limits::finite(dimension::number)));
            if (factors.back() == 0) {
                factor.fail("must not be 0");
            }
        }
        if (factors.size() != keys) {
            entry->fail(fmt::format("must be as many as the keys: {}, not {}", keys, factors.size()));
        }
    }
    return factors;
}

/// A value that every one of the parameter's keys allows.
double read_value(const Entry& entry, const std::vector<NumberRule>& rules, const Parameter& parameter) {
    double value = 0;
    for (std::size_t k = 0; k < rules.size(); ++k) {
        const bool same = parameter.factor(k) == 1;
        value = entry.number(same ? rules[k] : limits::finite(rules[k].dimension));
        if (!rules[k].allows(value * parameter.factor(k))) {
            entry.fail(fmt::format("times its factor, {} {}", parameter.keys[k], rules[k].rule));
        }
    }
    return value;
}

std::optional<Prior> read_prior(const Entry& entry, const std::vector<NumberRule>& rules, const Parameter& parameter) {
    const auto prior = entry.find("prior");
    if (!prior) {
        return std::nullopt;
    }
    prior->only({"mean", "sd"});
    return Prior{read_value(prior->at("mean"), rules, parameter),
                 prior->at("sd").number(limits::positive(rules.front().dimension))};
}

Parameter read_parameter(const Entry& entry, const Study& study) {
    entry.only({"name", "key", "keys", "factors", "initial", "lower", "upper", "scale", "prior"});
    Parameter parameter;
    const std::vector<NumberRule> rules = read_keys(entry, study, parameter);
    parameter.factors = read_factors(entry, parameter.keys.size());
    const auto name = entry.find("name");
    parameter.name = name ? name->text() : parameter.keys.front();
    const auto initial = entry.find("initial");
    parameter.initial = !initial && study.scene
                            ? *find_number(*study.scene, parameter.keys.front(), "", "").value / parameter.factor(0)
                            : read_value(entry.at("initial"), rules, parameter);
    parameter.lower = read_value(entry.at("lower"), rules, parameter);
    parameter.upper = read_value(entry.at("upper"), rules, parameter);
    const Quantity written = entry.at(initial ? "initial" : "lower").quantity();
    parameter.unit = written.unit;
    parameter.unit_factor = written.factor;
    if (!(parameter.lower < parameter.upper)) {
        entry.at("lower").fail("must be less than upper");
    }
    if (parameter.initial < parameter.lower || parameter.initial > parameter.upper) {
        if (initial) {
            initial->fail("must lie between lower and upper");
        }
        entry.at("lower").fail(fmt::format(
            "the scene's value, {:g} in SI units, must lie between lower and upper; or give initial", parameter.initial));
    }
    if (const auto scale = entry.find("scale")) {
        parameter.scale = scale->choice<Scale>({{"linear", Scale::linear}, {"log", Scale::logarithmic}});
        if (parameter.scale == Scale::logarithmic && !(parameter.lower > 0)) {
            entry.at("lower").fail("must be greater than 0 on a log scale");
        }
    }
    parameter.prior = read_prior(entry, rules, parameter);
    return parameter;
}

/// A name or a number that another parameter has already.
void check_unlike(const Entry& entry, const Parameter& parameter, const std::vector<Parameter>& others, const Study& study) {
    for (const Parameter& other : others) {
        if (other.name == parameter.name) {
            entry.fail(fmt::format("the name \"{}\" is taken: each parameter needs a name of its own", other.name));
        }
    }
    for (const std::string& key : parameter.keys) {
        if (const Parameter* owner = owner_of(numbers_at(study, key), others, study)) {
            entry.fail(fmt::format("{} belongs to the parameter \"{}\" already", key, owner->name));
        }
    }
}

}  // namespace

std::vector<const double*> numbers_at(const Study& study, const std::string& key) {
    std::vector<const double*> numbers;
    try {
        if (const auto found = find_machine_number(study, key, "", "")) {
            return {&(study.experiments[found->experiment].machine.*found->number->value)};
        }
    } catch (const InputError&) {  // none of a machine
        return {};
    }
    for (const Scene* scene : scenes_of(study)) {
        try {
            numbers.push_back(find_number(*scene, key, "", "").value);
        } catch (const InputError&) {  // not in this scene
        }
    }
    return numbers;
}

const Parameter* owner_of(const std::vector<const double*>& numbers, const std::vector<Parameter>& parameters,
                          const Study& study) {
    for (const Parameter& parameter : parameters) {
        for (const std::string& key : parameter.keys) {
            if (share_one(numbers, numbers_at(study, key))) {
                return &parameter;
            }
        }
    }
    return nullptr;
}

std::vector<Parameter> read_parameters(const Entry& list, const Study& study) {
    std::vector<Parameter> parameters;
    for (const Entry& entry : list.list()) {
        const Parameter parameter = read_parameter(entry, study);
        check_unlike(entry, parameter, parameters, study);
        parameters.push_back(parameter);
    }
    if (parameters.empty()) {
        list.fail("at least one parameter is needed");
    }
    return parameters;
}

}  // namespace crampfit
