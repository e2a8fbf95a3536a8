// Hard case: the same bits whatever the number of threads.
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"
#include "tests/forward/hard_cases.hpp"

namespace {

// Rows of the series, with all their digits, after a run with so many threads, asked for by option and by the libraries'
// variables.
std::string series(const std::string& scene, const std::string& kind, const std::string& threads) {
    for (const char* variable : {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"}) ::setenv(variable, threads.c_str(), 1);
    Command command;
    command.folder.write("scene.toml", scene);
    EXPECT_EQ(command
                  .run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5"), "--threads", threads, "--quiet",
                        "--set", "solver.kind=\"" + kind + "\""})
                  .status,
              0);
    return command.run({"csv", command.path("record.h5"), "series"}).out;
}

TEST(HardThreads, SameBits) {
    for (const std::string kind : {"quasistatic", "explicit"}) {
        const std::string one = series(small_scene, kind, "1");
        ASSERT_GT(one.size(), 1000u);
        for (const std::string threads : {"2", "4"})
            crampfit::test::hard_case(kind + ", " + threads + " threads", "the same series as with one, to the last digit",
                                      series(small_scene, kind, threads) == one ? 0.0 : 1.0, 0.0);
    }
}

}  // namespace
