// `crampfit evaluate`, as Dakota's fork interface calls it.
#include "datasets/io.hpp"
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <sstream>

using namespace crampfit;

namespace {

const std::string parameters = R"(
[[parameters]]
name = "toughness"
key = "materials.EW.toughness"
initial = "100 J/m^2"
lower = "50 J/m^2"
upper = "110 J/m^2"
scale = "log"

[[parameters]]
name = "the modulus"
key = "materials.EW.E"
initial = "50 MPa"
lower = "40 MPa"
upper = "80 MPa"
)";

std::string request(const std::string& toughness, const std::string& modulus, const std::vector<int>& active) {
    std::string text =
        fmt::format("2 variables\n{} the_modulus\n{} materials.EW.toughness\n{} functions\n", modulus, toughness, active.size());
    for (std::size_t k = 0; k < active.size(); ++k) text += fmt::format("{} ASV_{}:f{}\n", active[k], k + 1, k + 1);
    return text +
           "2 derivative_variables\n1 DVV_1:the_modulus\n2 DVV_2:materials.EW.toughness\n0 analysis_components\n1 eval_id\n";
}

struct Evaluator : Command {
    Outcome evaluate(const std::string& asked) {
        folder.write("params.in", asked);
        return run({"evaluate", path("study.toml"), path("params.in"), path("results.out"), "--quiet"});
    }
    std::vector<double> numbers() {
        std::vector<double> found;
        std::istringstream words(folder.read("results.out"));
        for (std::string word; words >> word;)
            if (word.find_first_not_of("+-.0123456789e") == std::string::npos) found.push_back(std::stod(word));
        return found;
    }
};

}  // namespace

// Peak force goes with sqrt(E Gc), stiffness with E (Griffith 1921).
TEST(SystemCommand, EvaluateGivesOutputsAndTheirGradients) {
    Evaluator command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml",
                         "scene = \"scene.toml\"\noutputs = [\"peak force\", \"initial stiffness\"]\n" + parameters);
    const Outcome outcome = command.evaluate(request("90", "60", {3, 3}));
    ASSERT_EQ(outcome.status, 0) << outcome.error;
    const std::vector<double> n = command.numbers();
    ASSERT_EQ(n.size(), 6u) << command.folder.read("results.out");
    EXPECT_NEAR(n[2] / n[0] * 60, 0.5, 1e-6);
    EXPECT_NEAR(n[3] / n[0] * 90, 0.5, 1e-6);
    EXPECT_NEAR(n[4] / n[1] * 60, 1.0, 1e-6);
    EXPECT_NEAR(n[5] / n[1] * 90, 0.0, 1e-6);
    const Outcome simulated = command.run({"simulate", command.path("scene.toml"), "-o", command.path("r.h5"), "--quiet", "--set",
                                           "materials.EW.E=60 MPa", "--set", "materials.EW.toughness=90 J/m^2"});
    ASSERT_EQ(simulated.status, 0);
    double peak = 0;
    for (const Instant& instant : read_record(command.path("r.h5")).series) peak = std::max(peak, instant.force);
    EXPECT_NEAR(n[0], peak, 1e-9 * peak);
    ASSERT_EQ(command.evaluate(request("90", "60", {0, 1})).status, 0);
    EXPECT_EQ(command.numbers(), std::vector<double>{n[1]});
    // By name, in another order.
    std::string named = request("90", "60", {3, 3});
    named.replace(named.find(":f1"), 3, ":initial_stiffness").replace(named.find(":f2"), 3, ":peak_force");
    ASSERT_EQ(command.evaluate(named).status, 0);
    EXPECT_EQ(command.numbers(), (std::vector<double>{n[1], n[0], n[4], n[5], n[2], n[3]}));
    named.replace(named.find(":peak_force"), 11, ":peak_farce");
    const Outcome unknown = command.evaluate(named);
    EXPECT_EQ(unknown.status, 2);
    EXPECT_TRUE(contains(unknown.error, "did you mean \"peak_force\"?")) << unknown.error;
    // An output that the run does not have matters only where it is asked for.
    command.folder.write("study.toml", "scene = \"scene.toml\"\noutputs = [\"peak force\", \"arrest length 1\"]\n" + parameters);
    ASSERT_EQ(command.evaluate(request("90", "60", {1, 0})).status, 0);
    EXPECT_EQ(command.numbers(), std::vector<double>{n[0]});
    EXPECT_EQ(command.evaluate(request("90", "60", {1, 1})).status, 1);
}

TEST(SystemCommand, NoResultGoesOverAFileThatIsRead) {
    Evaluator command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("data.csv", "displacement [mm],force [N]\n0,0\n0.1,3\n0.2,5\n0.3,8\n");
    command.folder.write("study.toml",
                         "[[experiments]]\nscene = \"scene.toml\"\ndata = \"data.csv\"\nnoise = { force = \"0.1 N\" }\n" +
                             parameters);
    command.folder.write("params.in", request("90", "60", {1}));
    const auto refused = [&](const std::vector<std::string>& words, const std::string& file) {
        const std::string before = command.folder.read(file);
        const Outcome outcome = command.run(words);
        EXPECT_EQ(outcome.status, 2) << file;
        EXPECT_TRUE(contains(outcome.error, "must not be a file that is read")) << outcome.error;
        EXPECT_EQ(command.folder.read(file), before);
    };
    const std::string study = command.path("study.toml"), scene = command.path("scene.toml");
    refused({"fit", study, "-o", scene}, "scene.toml");
    refused({"fit", study, "-o", command.path("data.csv")}, "data.csv");
    refused({"evaluate", study, command.path("params.in"), command.path("params.in")}, "params.in");
}

TEST(SystemCommand, EvaluateGivesResidualsOrTheirSquaresSummed) {
    Evaluator command;
    command.folder.write("scene.toml", slow_scene());
    command.folder.write("study.toml",
                         "[[experiments]]\nscene = \"scene.toml\"\ndata = \"data.csv\"\nnoise = { force = \"0.1 N\" }\n" +
                             parameters);
    command.folder.write("data.csv", "displacement [mm],force [N]\n0,0\n0.1,3\n0.2,5\n0.3,8\n");
    ASSERT_EQ(command.evaluate(request("90", "60", {1, 1, 1, 1})).status, 0) << command.folder.read("results.out");
    const std::vector<double> residuals = command.numbers();
    ASSERT_EQ(command.evaluate(request("90", "60", {3})).status, 0);
    const std::vector<double> misfit = command.numbers();
    ASSERT_EQ(misfit.size(), 3u);
    double sum = 0;
    for (const double r : residuals) sum += r * r;
    EXPECT_NEAR(misfit[0], sum, 1e-12 * sum);
    // Its slope by the modulus against that of the misfit itself.
    ASSERT_EQ(command.evaluate(request("90", "60.01", {1})).status, 0);
    const double more = command.numbers()[0];
    ASSERT_EQ(command.evaluate(request("90", "59.99", {1})).status, 0);
    const double less = command.numbers()[0];
    EXPECT_NEAR(misfit[1], (more - less) / 0.02, 1e-5 * std::abs(misfit[1]));
    const Outcome wrong = command.evaluate(request("90", "-60", {1, 1}));  // nothing has been run, or that would have failed
    EXPECT_EQ(wrong.status, 2);
    EXPECT_TRUE(contains(wrong.error, "must be as many as the functions")) << wrong.error;
}

TEST(SystemCommand, EvaluateTellsDakotaOfFailures) {
    Evaluator command;
    command.folder.write("scene.toml", small_scene);
    command.folder.write("study.toml", "scene = \"scene.toml\"\noutputs = [\"peak force\"]\n" + parameters);
    EXPECT_EQ(command.evaluate(request("90", "60", {4})).status, 1);
    EXPECT_EQ(command.folder.read("results.out").rfind("fail: Hessians", 0), 0u);
    EXPECT_EQ(command.evaluate(request("90", "60", {2})).status, 1);  // explicit dynamics
    EXPECT_EQ(command.folder.read("results.out").rfind("fail: gradients", 0), 0u);
    EXPECT_EQ(command.evaluate(request("-90", "60", {1})).status, 1);
    EXPECT_EQ(command.folder.read("results.out").rfind("fail: ", 0), 0u);
    EXPECT_TRUE(contains(command.folder.read("results.out"), "must be greater than 0"));
    std::string unknown = request("90", "60", {1});
    unknown.replace(unknown.find("the_modulus"), 11, "the_modulos");
    const Outcome outcome = command.evaluate(unknown);
    EXPECT_EQ(outcome.status, 2);
    EXPECT_TRUE(contains(outcome.error, "is no parameter of the study")) << outcome.error;
    EXPECT_TRUE(contains(command.folder.read("results.out"), "fail: ")) << "no answer to an earlier question";
    EXPECT_TRUE(contains(command.folder.read("results.out"), "is no parameter of the study"));
    command.folder.write("study.toml", "scene = \"nowhere.toml\"\noutputs = [\"peak force\"]\n" + parameters);
    command.folder.write("results.out", "0.5 peak_force\n");
    EXPECT_EQ(command.evaluate(request("90", "60", {1})).status, 2);
    EXPECT_TRUE(contains(command.folder.read("results.out"), "fail: ")) << command.folder.read("results.out");
    command.folder.write("results.out", "displacement [mm],force [N]\n");  // what may be something else stays
    EXPECT_EQ(command.evaluate(request("90", "60", {1})).status, 2);
    EXPECT_TRUE(contains(command.folder.read("results.out"), "displacement"));
}
