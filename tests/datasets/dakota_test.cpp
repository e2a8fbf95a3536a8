// Files of Dakota, as its manual and its own tests of dakota.interfacing have them.
#include "datasets/dakota.hpp"
#include "datasets/error.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

using namespace crampfit;

namespace {

const std::string standard = R"(                                          3 variables
                      7.488318331306800e-01 x1
                      2.188638686202466e-01 x2
                                    foo bar dussv_1
                                          2 functions
                                          3 ASV_1:response_fn_1
                                          2 ASV_2:response_fn_2
                                          2 derivative_variables
                                          2 DVV_1:x2
                                          1 DVV_2:x1
                                          2 analysis_components
                                        a b AC_1:first.sh
                                          b AC_2:first.sh
                                        1:2 eval_id
                                          0 metadata
)";

const std::string aprepro = R"(                    { DAKOTA_VARS     =                      3 }
                    { x1              =  7.488318331306800e-01 }
                    { x2              =  2.188638686202466e-01 }
                    { dussv_1         =                      "foo bar" }
                    { DAKOTA_FNS      =                      2 }
                    { ASV_1:response_fn_1 =                  3 }
                    { ASV_2:response_fn_2 =                  2 }
                    { DAKOTA_DER_VARS =                      2 }
                    { DVV_1:x2        =                      2 }
                    { DVV_2:x1        =                      1 }
                    { DAKOTA_AN_COMPS =                      2 }
                    { AC_1:first.sh   =                      "a b" }
                    { AC_2:first.sh   =                      "b" }
                    { DAKOTA_EVAL_ID  =                      1:2 }
                    { DAKOTA_METADATA =                      0 }
)";

// Without labels, evaluation number and what comes after.
const std::string old =
    "2 variables\n1.5 a\n-2e3 b\n1 functions\n1 ASV_1\n2 derivative_variables\n1 DVV_1\n2 DVV_2\n0 analysis_components\n";

}  // namespace

TEST(UnitDakota, ReadsBothFormats) {
    const TemporaryFolder folder;
    for (const std::string& text : {standard, aprepro}) {
        const DakotaRequest request = read_dakota_request(folder.write("params.in", text));
        ASSERT_EQ(request.variables.size(), 3u);
        EXPECT_EQ(request.variables[1], (std::pair<std::string, std::string>("x2", "2.188638686202466e-01")));
        EXPECT_EQ(request.variables[2], (std::pair<std::string, std::string>("dussv_1", "foo bar")));
        EXPECT_EQ(request.active, (std::vector{3, 2}));
        EXPECT_EQ(request.labels, (std::vector<std::string>{"response_fn_1", "response_fn_2"}));
        EXPECT_EQ(request.derivative_variables, (std::vector<std::size_t>{1, 0}));
    }
    const DakotaRequest request = read_dakota_request(folder.write("params.in", old));
    EXPECT_EQ(request.variables[1].second, "-2e3");
    EXPECT_EQ(request.labels, std::vector<std::string>{""});
}

TEST(UnitDakota, FunctionsGoByTheOutputsNames) {
    const std::vector<std::string> names{"peak force", "force at 0.3 mm", "work of fracture"};
    const auto asked = [&](const std::vector<std::string>& labels) {
        DakotaRequest request;
        request.labels = labels;
        return outputs_asked_for(request, names, "params.in");
    };
    const std::vector<std::size_t> in_order{0, 1, 2};
    EXPECT_EQ(asked({"work_of_fracture", "peak_force", "force_at_0.3_mm"}), (std::vector<std::size_t>{2, 0, 1}));
    EXPECT_EQ(asked({"", "", ""}), in_order);
    EXPECT_EQ(asked({"f1", "f2", "f3"}), in_order);
    EXPECT_EQ(asked({"response_fn_1", "response_fn_2", "response_fn_3"}), in_order);
    const std::pair<std::vector<std::string>, std::string> wrong[] = {
        {{"peak_force", "peak_force", "work_of_fracture"}, "ASV_2"},
        {{"peak_force", "f2", "work_of_fracture"}, "ASV_2"},
        {{"f2", "f1", "f3"}, "ASV_1"},
        {{"f1", "f2", "work_of_fractur"}, "ASV_3"},
    };
    for (const auto& [labels, key] : wrong) {
        try {
            asked(labels);
            ADD_FAILURE() << "no error for " << labels[1];
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, key) << error.what();
        }
    }
}

TEST(UnitDakota, WritesValuesThenGradientsThatWereAskedFor) {
    const TemporaryFolder folder;
    const DakotaRequest request = read_dakota_request(folder.write("params.in", standard));
    write_dakota_results(request, {1.0 / 3.0, 7.0}, {{0.5, -2.0}, {1e-300, 4}}, folder / "results.out");
    EXPECT_EQ(folder.read("results.out"), "0.3333333333333333 response_fn_1\n[ 0.5 -2 ]\n[ 1e-300 4 ]\n");
    write_dakota_failure("first\nsecond", folder / "results.out");
    EXPECT_EQ(folder.read("results.out"), "fail: first second\n");
}

TEST(UnitDakota, RefusesOtherFiles) {
    const TemporaryFolder folder;
    const std::pair<std::string, std::string> table[] = {
        {"", "variables"},
        {"2 variables\n1 a\n", "variables"},
        {"x variables\n", "variables"},
        {"1 variables\n1 a\n1 functions\n8 ASV_1:f\n0 derivative_variables\n", "ASV_1:f"},
        {"1 variables\n1 a\n1 functions\n1 ASV_1:f\n1 derivative_variables\n2 DVV_1:b\n", "DVV_1:b"},
        {"1 functions\n", "functions"},
        {old + "1 eval_id\n1 metadata\nseconds MD_1\n", "MD_1"},
    };
    for (const auto& [text, key] : table) {
        try {
            read_dakota_request(folder.write("params.in", text));
            ADD_FAILURE() << "no error for " << text;
        } catch (const InputError& error) {
            EXPECT_EQ(error.key, key) << error.what();
            EXPECT_EQ(error.file, (folder / "params.in").string());
        }
    }
    EXPECT_THROW(read_dakota_request(folder.write("params.in", "{ DAKOTA_VARS = 1\n")), InputError);
    EXPECT_THROW(read_dakota_request(folder / "none.in"), InputError);
}
