#include "inverse/run_store.hpp"
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "datasets/run_journal.hpp"
#include "forward/simulate.hpp"
#include "inverse/fit.hpp"
#include "inverse/sensitivity.hpp"
#include "tests/inverse/fake_wedge.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <array>
#include <bit>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <map>
#include <sys/wait.h>
#include <thread>
#include <unistd.h>

namespace crampfit::testing {
namespace {

std::uint64_t bits(double x) { return std::bit_cast<std::uint64_t>(x); }

void expect_same_bits(const Fit& a, const Fit& b) {
    ASSERT_EQ(a.runs.size(), b.runs.size());
    for (std::size_t i = 0; i < a.runs.size(); ++i) {
        EXPECT_EQ(a.runs[i].parameters, b.runs[i].parameters);
        EXPECT_EQ(bits(a.runs[i].misfit), bits(b.runs[i].misfit));
        EXPECT_EQ(a.runs[i].status, b.runs[i].status);
    }
    EXPECT_EQ(a.covariance, b.covariance);
    EXPECT_EQ(a.message, b.message);
    ASSERT_EQ(a.residuals.size(), b.residuals.size());
    for (std::size_t i = 0; i < a.residuals.size(); ++i) {
        EXPECT_EQ(bits(a.residuals[i].modelled), bits(b.residuals[i].modelled));
    }
}

// Each run takes a while, fails now and then, and before it begins leaves its parameters' bits in a file.
Forward slow_and_told(const std::filesystem::path& diary, int milliseconds) {
    return [diary, milliseconds](const Scene& scene, const std::atomic<bool>*) {
        const double toughness[] = {scene.materials.at("EW").toughness, scene.materials.at("LW").toughness};
        std::FILE* file = std::fopen(diary.c_str(), "a");
        std::fwrite(toughness, sizeof toughness, 1, file);
        std::fclose(file);
        std::this_thread::sleep_for(std::chrono::milliseconds(milliseconds));
        if (scramble(toughness[0], toughness[1]) < 0.2) {
            throw std::runtime_error("lost");
        }
        return FakeWedge{}(scene);
    };
}

using Values = std::array<double, 2>;

// How many times each run has begun.
std::map<Values, int> begun(const std::filesystem::path& diary) {
    std::map<Values, int> times;
    std::ifstream in(diary, std::ios::binary);
    for (Values values; in.read(reinterpret_cast<char*>(values.data()), sizeof values);) {
        ++times[values];
    }
    return times;
}

// The runs that a journal holds: entries of length, checksum, and then the number of parameters, the parameters and more.
std::vector<Values> kept(const std::filesystem::path& journal) {
    std::vector<Values> runs;
    std::ifstream in(journal, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(in), {}};
    const auto number = [&](std::size_t at) {
        std::uint64_t value = 0;
        std::memcpy(&value, bytes.data() + at, sizeof value);
        return value;
    };
    for (std::size_t at = 0; at + 16 <= bytes.size() && at + 16 + number(at) <= bytes.size(); at += 16 + number(at)) {
        if (at > 0) {  // the first says whose runs these are
            std::memcpy(runs.emplace_back().data(), bytes.data() + at + 24, sizeof(Values));
        }
    }
    return runs;
}

// Killed 20 times or more, until enough runs were kept, at moments drawn at random, resumed each time, in the end left to finish.
TEST(SystemResume, AFitKilledAtRandomEndsAtTheSameBitsAndRepeatsNoRun) {
    const TemporaryFolder folder;
    Study study = wedge_study(FakeWedge{}, 0.02, 1e-4);
    study.optimizer = {.method = "sbplx", .starts = 2, .max_runs = 120};
    FitOptions options;
    options.threads = 2;
    options.forward = slow_and_told(folder / "whole.txt", 0);
    const Fit whole = fit_study(study, options);

    options.forward = slow_and_told(folder / "diary.txt", 4);
    options.keeping = {folder / "fit.runs", true};
    std::mt19937 generator(11);
    int killed = 0, rounds = 0;
    std::map<Values, int> begun_when_kept;
    for (; rounds < 20 || (begun_when_kept.size() <= 20 && rounds < 100); ++rounds) {  // a busy machine keeps few in a round
        const pid_t child = ::fork();
        if (child == 0) {
            fit_study(study, options);
            ::_exit(0);
        }
        std::this_thread::sleep_for(std::chrono::microseconds(5000 + generator() % 15000) * (1 + rounds / 20));
        ::kill(child, SIGKILL);
        int status = 0;
        ::waitpid(child, &status, 0);
        killed += WIFSIGNALED(status) ? 1 : 0;
        const auto times = begun(folder / "diary.txt");
        for (const Values& run : kept(folder / "fit.runs")) {
            begun_when_kept.emplace(run, times.at(run));
        }
    }
    options.threads = 3;
    const Fit resumed = fit_study(study, options);
    expect_same_bits(resumed, whole);
    const auto times = begun(folder / "diary.txt");
    std::printf("%d kills, %zu runs, %zu kept before the last start\n", killed, times.size(), begun_when_kept.size());
    EXPECT_EQ(times.size(), whole.runs.size());
    EXPECT_EQ(killed, rounds);
    EXPECT_GT(begun_when_kept.size(), 20u);
    for (const auto& [run, count] : begun_when_kept) {
        EXPECT_EQ(times.at(run), count) << "run again though it was kept";
    }

    options.forward = [](const Scene&, const std::atomic<bool>*) -> Record { throw std::logic_error("run again"); };
    expect_same_bits(fit_study(study, options), whole);
}

// Wheels drive a notch apart: each equilibrium is found from those before it. Wherever the journal ends, as after a kill, the
// same runs and searches come after it, with the same bits.
TEST(SlowResume, AFitWithWheelsGoesOnFromAnywhereWithTheSameBits) {
    const TemporaryFolder folder;
    Study study;
    Experiment& experiment = study.experiments.emplace_back();
    experiment.name = "wedge";
    experiment.scene = read_scene(std::filesystem::path(SAMPLES) / "wedge.toml");
    experiment.scene.model.cell = 0.4e-3;
    experiment.scene.specimen.picture.reset();
    experiment.scene.specimen.rings = Rings{Vec2(5e-3, 30e-3), 2.2e-3, 0.25, 0.3e-3};
    experiment.scene.cracks[0].advance = 0.8e-3;
    experiment.scene.stop.crack_length = 2.7e-3;
    experiment.scene.output.frames = 0;
    experiment.noise.force = 0.5;
    experiment.noise.crack_length = 1e-4;
    Record record = simulate(experiment.scene);
    std::vector<Instant> rows;
    for (std::size_t i = 0; i < record.series.size(); i += 4) {
        rows.push_back(record.series[i]);
    }
    record.series = rows;
    experiment.data = measure(record, *experiment.noise.force, *experiment.noise.crack_length, 3);
    study.parameters = {toughness_parameter("EW", 40)};
    for (const auto& [wood, initial] : {std::pair("EW", 15e6), std::pair("LW", 3000e6)}) {
        Parameter modulus = toughness_parameter(wood, initial);
        modulus.name = std::string(wood) + " modulus";
        modulus.keys = {std::string("materials.") + wood + ".E"};
        modulus.lower = 0.2 * initial;
        modulus.upper = 5 * initial;
        study.parameters.push_back(modulus);
    }
    study.optimizer.max_runs = 12;
    FitOptions options;
    options.threads = 1;
    options.keeping = {folder / "fit.runs", false};
    const Fit whole = fit_study(study, options);
    const std::string bytes = folder.read("fit.runs");
    ASSERT_GT(whole.runs.size(), 3u);
    options.keeping.resume = true;
    std::mt19937 generator(7);
    for (int i = 0; i < 5; ++i) {
        const std::size_t left = i == 0 ? bytes.size() : generator() % bytes.size();
        folder.write("fit.runs", bytes.substr(0, left));
        std::printf("resumed after %zu of %zu bytes\n", left, bytes.size());
        expect_same_bits(fit_study(study, options), whole);
        EXPECT_EQ(folder.read("fit.runs").size(), bytes.size());
    }
}

TEST(SystemResume, ATornLastEntryCostsOneRun) {
    const TemporaryFolder folder;
    const Study study = wedge_study(FakeWedge{}, 0.02, 1e-4);
    FitOptions options = with(FakeWedge{});
    options.keeping = {folder / "fit.runs", false};
    const Fit whole = fit_study(study, options);
    const std::string bytes = folder.read("fit.runs");
    options.keeping.resume = true;
    int runs = 0;
    options.forward = [&](const Scene& scene, const std::atomic<bool>*) {
        ++runs;
        return FakeWedge{}(scene);
    };
    for (const std::size_t lost : {std::size_t{1}, std::size_t{17}, bytes.size() - 1, bytes.size() - 30, bytes.size()}) {
        folder.write("fit.runs", bytes.substr(0, bytes.size() - lost));
        runs = 0;
        expect_same_bits(fit_study(study, options), whole);
        EXPECT_EQ(folder.read("fit.runs").size(), bytes.size());
        EXPECT_EQ(runs, lost < 100 ? 1 : static_cast<int>(whole.runs.size()));
    }
    std::string spoilt = bytes;
    spoilt[bytes.size() / 2] ^= 1;
    folder.write("fit.runs", spoilt);
    expect_same_bits(fit_study(study, options), whole);
}

// Who forgets --resume has not lost what was kept.
TEST(UnitResume, WithoutItKeptRunsStayBeside) {
    const TemporaryFolder folder;
    const Study study = wedge_study(FakeWedge{}, 0.02, 1e-4);
    FitOptions options = with(FakeWedge{});
    options.keeping = {folder / "fit.runs", false};
    fit_study(study, options);
    EXPECT_FALSE(std::filesystem::exists(folder / "fit.runs~"));
    const std::string kept_before = folder.read("fit.runs");
    options.forward = [](const Scene&, const std::atomic<bool>*) -> Record { throw std::runtime_error("lost"); };
    fit_study(study, options);
    EXPECT_EQ(folder.read("fit.runs~"), kept_before);
    EXPECT_NE(folder.read("fit.runs"), kept_before);
}

TEST(UnitResume, RunsOfAnotherStudyAndOtherFilesAreRefused) {
    const TemporaryFolder folder;
    Study study = wedge_study(FakeWedge{}, 0.02, 1e-4);
    FitOptions options = with(FakeWedge{});
    options.keeping = {folder / "fit.runs", false};
    fit_study(study, options);
    options.keeping.resume = true;
    study.optimizer.max_runs = 70;  // may change
    study.parameters[0].upper = 390;
    EXPECT_NO_THROW(fit_study(study, options));
    study.experiments[0].data.force[7] += 1e-9;  // may not
    EXPECT_THROW(fit_study(study, options), InputError);
    options.keeping.resume = false;
    EXPECT_NO_THROW(fit_study(study, options));
    folder.write("fit.runs", std::string(1000, 'x'));
    EXPECT_THROW(fit_study(study, options), InputError);
    EXPECT_EQ(folder.read("fit.runs").size(), 1000u);
    folder.write("fit.runs", "notes");  // as short as a head that a kill has torn
    EXPECT_THROW(fit_study(study, options), InputError);
    EXPECT_EQ(folder.read("fit.runs"), "notes");
}

TEST(SystemResume, RunsWhoseBytesWouldBeLineEndsOfATextAreReadBack) {
    const TemporaryFolder folder;
    for (const std::uint64_t byte : {0x0du, 0x0au, 0x1au, 0xffu}) {
        const double number = std::bit_cast<double>(byte * 0x0101010101010101u);
        { RunJournal(folder / "fit.runs", 1, false).add({{number}, {number, number}, "completed", number}); }
        const RunJournal again(folder / "fit.runs", 1, true);
        ASSERT_EQ(again.found().size(), 1u) << byte;
        EXPECT_EQ(bits(again.found()[0].parameters.at(0)), bits(number)) << byte;
        EXPECT_EQ(bits(again.found()[0].results.at(1)), bits(number)) << byte;
    }
}

TEST(SystemResume, ASensitivityStudyGoesOn) {
    const TemporaryFolder folder;
    Study study = wedge_study(FakeWedge{});
    study.scene = study.experiments[0].scene;
    study.experiments.clear();
    study.outputs = {{"peak force", StudyOutput::Kind::peak_force, 0, 0}, {"arrest", StudyOutput::Kind::arrest_length, 0, 3}};
    study.sensitivity = {SensitivityMethod::sobol, 8};
    SensitivityOptions options;
    options.threads = 2;
    options.forward = slow_and_told(folder / "diary.txt", 0);
    const Sensitivity whole = study_sensitivity(study, options);
    options.keeping = {folder / "out.runs", false};
    std::atomic<bool> stop{false};
    options.stop_requested = &stop;
    std::atomic<int> runs{0};
    options.forward = [&, inner = options.forward](const Scene& scene, const std::atomic<bool>* flag) {
        stop = ++runs >= 15;
        return inner(scene, flag);
    };
    EXPECT_EQ(study_sensitivity(study, options).status, SensitivityStatus::interrupted);
    options.keeping.resume = true;
    options.stop_requested = nullptr;
    const Sensitivity resumed = study_sensitivity(study, options);
    EXPECT_GE(runs, 32);
    EXPECT_LE(runs, 34);  // those that failed at the very end of the first part are not known to have failed by themselves
    ASSERT_EQ(resumed.indices.size(), whole.indices.size());
    for (std::size_t i = 0; i < whole.indices.size(); ++i) {
        EXPECT_EQ(bits(resumed.indices[i].value), bits(whole.indices[i].value));
        EXPECT_EQ(bits(resumed.indices[i].upper_95), bits(whole.indices[i].upper_95));
    }
}

TEST(SystemResume, RunsThatHangAreStoppedAndRecorded) {
    Study study = wedge_study(FakeWedge{}, 0.02, 1e-4);
    study.time_limit = 0.02;
    study.experiments[0].scene.file = "wedge's.toml";
    study.scene_settings = {{"model.cell", "0.1 mm"}};
    FitOptions options;
    options.threads = 2;
    options.forward = [](const Scene& scene, const std::atomic<bool>* stop) {
        Record record = FakeWedge{}(scene);
        if (scramble(scene.materials.at("EW").toughness, scene.materials.at("LW").toughness) < 0.1) {
            while (!*stop) {
                std::this_thread::sleep_for(std::chrono::milliseconds(1));
            }
            record.status = RunStatus::interrupted;
        }
        return record;
    };
    std::string failure;
    options.progress = [&](const FitProgress& progress) { failure = progress.failure.empty() ? failure : progress.failure; };
    const Fit fit = fit_study(study, options);
    EXPECT_EQ(fit.status, FitStatus::converged);
    EXPECT_NEAR(fit.parameters[0].value / true_earlywood, 1, 0.03);
    EXPECT_NE(failure.find("longer than runs.time_limit = 0.02 s"), std::string::npos) << failure;
    EXPECT_NE(failure.find("crampfit simulate 'wedge'\\''s.toml' --set 'model.cell=0.1 mm' --set 'materials.EW.toughness=\""),
              std::string::npos)
        << failure;
}

TEST(SystemResume, RunsThatHadTooLittleTimeAreMadeAgainWithMore) {
    const TemporaryFolder folder;
    Study study = wedge_study(FakeWedge{}, 0.02, 1e-4);
    study.optimizer = {.method = "sbplx", .max_runs = 6};
    study.time_limit = 0.02;
    int runs = 0;
    FitOptions options;
    options.threads = 1;
    options.keeping = {folder / "fit.runs", false};
    options.forward = [&runs](const Scene& scene, const std::atomic<bool>* stop) {
        const auto begin = std::chrono::steady_clock::now();
        Record record = FakeWedge{}(scene);
        while (std::chrono::steady_clock::now() - begin < std::chrono::milliseconds(80)) {
            if (stop && *stop) {
                record.status = RunStatus::interrupted;
                break;
            }
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        ++runs;
        return record;
    };
    EXPECT_EQ(fit_study(study, options).status, FitStatus::failed);
    options.keeping.resume = true;
    struct Call {
        std::optional<double> limit;
        bool runs_again, fails;
    };
    const double little = 0.02, enough = 60.0;
    for (const Call& call :
         {Call{little, false, true}, Call{enough, true, false}, Call{little, false, false}, Call{{}, false, false}}) {
        runs = 0;
        study.time_limit = call.limit;
        const Fit fit = fit_study(study, options);
        EXPECT_EQ(runs > 0, call.runs_again) << call.limit.value_or(0);
        EXPECT_EQ(fit.status == FitStatus::failed, call.fails) << call.limit.value_or(0);
    }
}

}  // namespace
}  // namespace crampfit::testing
