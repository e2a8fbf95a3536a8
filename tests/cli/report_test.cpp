#include "datasets/crack_track.hpp"
#include "datasets/displacement_field.hpp"
#include "datasets/io.hpp"
#include "datasets/specimen.hpp"
#include "inverse/lack_of_fit.hpp"
#include "tests/cli/command.hpp"
#include "tests/cli/scenes.hpp"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <random>

using namespace crampfit;

namespace {

constexpr std::size_t most_bytes = 5'000'000;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

int count(const std::string& text, const std::string& part) {
    int found = 0;
    for (std::size_t at = text.find(part); at != std::string::npos; at = text.find(part, at + part.size())) ++found;
    return found;
}

/// Python's parser, which takes no tag that is not closed, no open quote and no forbidden character.
bool is_well_formed(const std::filesystem::path& file) {
    const std::string parse = "import sys, xml.etree.ElementTree as tree; tree.parse(sys.argv[1])";
    return std::system(fmt::format("/usr/bin/python3 -c '{}' '{}'", parse, file.string()).c_str()) == 0;
}

/// The page of a result that stands in the command's folder; empty when the command fails.
std::string report(Command& command, const std::string& file) {
    const Outcome outcome = command.run({"report", command.path(file), "-o", command.path("page.html"), "--quiet"});
    EXPECT_EQ(outcome.status, 0) << outcome.error;
    const std::string page = command.folder.read("page.html");
    EXPECT_TRUE(is_well_formed(command.path("page.html")));
    EXPECT_LT(page.size(), most_bytes);
    // Nothing is fetched: what a page can fetch stands in src, href and url().
    EXPECT_EQ(count(page, "src="), 0);
    EXPECT_EQ(count(page, "url("), 0);
    EXPECT_EQ(count(page, "href="), count(page, "href=\"data:image/png;base64,"));
    EXPECT_TRUE(contains(page, "default-src 'none'"));
    EXPECT_EQ(count(page, "<script>"), 1);
    return page;
}

std::string hostile_scene() {
    std::string scene = small_scene + "\n[output]\nframes = 4\n";
    const std::string title = "block under tension";
    return scene.replace(scene.find(title), title.size(), "<script>alert(1)</script> & <b>more</b>");
}

Fit small_fit() {
    Fit fit;
    fit.method = "Ceres, since derivatives are exact";
    fit.study_text = "title = \"E & G of a <block>\"\n";
    fit.scene_settings = " --set 'model.cell=0.2 mm'";
    fit.parameters = {{.name = "E",
                       .key = "materials.EW.E",
                       .value = 40,
                       .unit = "MPa",
                       .standard_error = 1,
                       .lower_95 = 38,
                       .upper_95 = 42,
                       .initial = 60},
                      {.name = "toughness <EW>",
                       .key = "materials.EW.toughness",
                       .value = 100,
                       .unit = "J/m^2",
                       .standard_error = 5,
                       .lower_95 = 90,
                       .upper_95 = 111,
                       .initial = 80,
                       .at_bound = true}};
    fit.correlation = Eigen::MatrixXd::Identity(2, 2);
    fit.correlation(0, 1) = fit.correlation(1, 0) = -0.5;
    fit.covariance = fit.correlation;
    for (int i = 0; i < 20; ++i) {
        fit.residuals.push_back({"pull", "force", 1e-5 * i, 2.0 * i, 2.0 * i + 0.1, 0.5, 0.2});
        fit.residuals.push_back({"pull", "arrival", 1e-3 + 1e-4 * i, 1e-5 * i, 1e-5 * i, 1e-6, 0});
        fit.profile.push_back({"E", 38 + 0.2 * i, 5 + 0.01 * (i - 10) * (i - 10)});
        fit.posterior.push_back({{40 + 0.1 * i, 100 - 0.3 * i}, 6});
        fit.runs.push_back(
            {{60.0 - i, 80.0 + i}, i == 3 ? INFINITY : 100.0 / (i + 1), i == 3 ? "did not converge" : "finished", 0.1});
    }
    fit.models = {{"hoop stress", "converged", 5, {40, 100}, 9, 11, 0.9}, {"straight", "converged", 9, {41, 99}, 13, 15, 0.1}};
    const std::vector<Vec2> photographed{{0, 5e-3}, {4e-3, 5e-3}, {9e-3, 7e-3}}, straight{{0, 5e-3}, {9e-3, 5e-3}};
    fit.crack_paths = {
        {"pull",
         true,
         {200, 100, std::vector<std::uint8_t>(20000, 180), {-1e-3, 0}, {11e-3, 6e-3}},
         photographed,
         {{"hoop stress", "finished", {photographed}, 1e-5, 2e-5, 5e-3}, {"straight", "split", {straight}, 1e-3, 2e-3, 5e-3}}},
        {"other",
         false,
         {30, 30, std::vector<std::uint8_t>(900, 90), {0, 0}, {1e-2, 1e-2}},
         {},
         {{"hoop stress", "no run ended well", {}}, {"straight", "finished", {straight}}}}};
    fit.checks = {{"pull", "force", 20, 0.8, 1, 0.9, 1e-5}, {"pull", "arrival", 20, 0, 1, 0, 0.5}};
    fit.message = "Converged. " + lack_of_fit(fit.checks) + "pull: weight 1. ";
    fit.misfit = 5;
    fit.reduced_chi_square = 0.2;
    return fit;
}

}  // namespace

TEST(SystemReport, PageOfARecordShowsAllOfItAndEscapesText) {
    Command command;
    command.folder.write("scene.toml", hostile_scene());
    ASSERT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5")}).status, 0);
    const Record record = read_record(command.path("record.h5"));
    ASSERT_GE(record.frames.size(), 2u);
    const std::string page = report(command, "record.h5");
    EXPECT_EQ(count(page, "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &lt;b&gt;more&lt;/b&gt;"), 4)
        << "title, head, explanation, scene";
    for (const char* part : {"Force [", "Crack length [mm]", "Energy release rate G [J/m²]", "Stress intensity factors [",
                             "Energies [", "[materials.EW]", "crampfit simulate scene.toml -o record.h5", "x [mm]"})
        EXPECT_TRUE(contains(page, part)) << part;
    // The slider has each frame, with a sentence; the map is one picture, the deformed specimen one a frame.
    EXPECT_TRUE(contains(page, fmt::format("max=\"{}\"", record.frames.size() - 1)));
    EXPECT_EQ(count(page, "<p data-frame="), static_cast<int>(record.frames.size()));
    EXPECT_EQ(count(page, "<p data-frame=\"0\">"), 1);
    EXPECT_EQ(count(page, "<image "), 1 + static_cast<int>(record.frames.size()));
    // Without a script, and in print, the last frame is seen: its sentence, crack, picture, and places on three curves.
    EXPECT_EQ(count(page, "class=\"shown last\""), 6);
}

TEST(SystemReport, PageOfARecordThatHoldsNextToNothing) {
    Command command;
    Record record;
    record.status = RunStatus::unstable;
    record.message = "bytes \xff\xc3( and \x01 and \xe2\x82\xac";  // no UTF-8, a forbidden character, a euro
    record.scene_text = "this is no TOML";
    write(record, command.path("empty.h5"));
    const std::string page = report(command, "empty.h5");
    EXPECT_TRUE(contains(page, "bytes \xef\xbf\xbd\xef\xbf\xbd( and \xef\xbf\xbd and \xe2\x82\xac"));
    EXPECT_TRUE(contains(page, "<title>empty.h5</title>"));
    record.series = {{.time = 0, .force = INFINITY}, {.time = 1, .force = nothing, .G = 1}};
    write(record, command.path("infinite.h5"));
    EXPECT_TRUE(contains(report(command, "infinite.h5"), "Energy release rate G [J/m²]"));
    // One point, thrown away by a run that went unstable.
    record.point_position = {{1e-3, 2e-3}};
    record.point_latewood = {0};
    record.frames = {{.time = 1, .moved = {{1e30f, INFINITY}}, .stress = {Eigen::Vector4f::Constant(INFINITY)}, .crack = {}}};
    write(record, command.path("unstable.h5"));
    EXPECT_EQ(count(report(command, "unstable.h5"), "<image "), 2);
}

TEST(SystemReport, PageOfAFitShowsDataIntervalsProfilesPosteriorAndRuns) {
    Command command;
    write(small_fit(), command.path("fit.h5"));
    const std::string page = report(command, "fit.h5");
    EXPECT_TRUE(contains(page, "<title>E &amp; G of a &lt;block&gt;</title>"));
    EXPECT_TRUE(contains(page, "<p>Converged.</p>\n<p class=\"warning\">Lack of fit: the residuals of force of"));
    EXPECT_TRUE(contains(page, "<p>pull: weight 1.</p>"));
    for (const char* part : {"38 to 42", "90 to 111", "toughness &lt;EW&gt;", "pull: force", "pull: arrival of the crack",
                             "Profile of E", "Posterior of E", "E and toughness", "-0.50", "did not converge",
                             "crampfit fit study.toml --set &#39;model.cell=0.2 mm&#39; -o fit.h5"})
        EXPECT_TRUE(contains(page, part)) << part;
    // A point for each: two curves with a legend each, their residuals, the profile, the samples, the runs that ended, their
    // legend.
    EXPECT_EQ(count(page, "<circle "), 20 + 1 + 20 + 20 + 1 + 20 + 20 + 20 + 19 + 1);
    EXPECT_FALSE(contains(page, "nan") || contains(page, "inf ")) << "in a path";
}

TEST(SystemReport, PageOfAFitShowsThePathOfEachModelOverThePhotographedOne) {
    Command command;
    write(small_fit(), command.path("fit.h5"));
    const std::string page = report(command, "fit.h5");
    // In the table of evidence: over both experiments, of which one was photographed.
    for (const char* part :
         {"Path off by, mean [mm]", "<td class=\"number\">0.010</td><td class=\"number\">0.020</td>",
          "<td class=\"number\">1.000</td><td class=\"number\">2.000</td>", "Over [mm]", "no run ended well", "pull: photograph",
          "pull: hoop stress", "pull: straight", "other: wood of the model", "other: straight"})
        EXPECT_TRUE(contains(page, part)) << part;
    EXPECT_FALSE(contains(page, "other: hoop stress")) << "it has no path";
    // All over the whole, and each by itself; of the other experiment one path.
    EXPECT_EQ(count(page, "<image "), 3 + 2);
    EXPECT_EQ(count(page, ">photographed</text>"), 3);
    Fit plain = small_fit();
    plain.crack_paths.clear();
    write(plain, command.path("plain.h5"));
    EXPECT_FALSE(contains(report(command, "plain.h5"), "Crack paths"));
}

// Noise is what compresses worst.
TEST(SystemReport, PageOfManyPhotographsStaysSmall) {
    Command command;
    Fit fit = small_fit();
    fit.crack_paths.resize(1);
    PlanePicture& picture = fit.crack_paths[0].picture;
    picture.columns = picture.rows = 1600;
    std::mt19937 random(1);
    picture.gray.clear();
    for (int i = 0; i < 1600 * 1600; ++i) picture.gray.push_back(static_cast<std::uint8_t>(random()));
    fit.crack_paths.resize(4, fit.crack_paths[0]);
    write(fit, command.path("fit.h5"));
    const std::string page = report(command, "fit.h5");
    std::printf("page of four photographs of noise and two models each: %.2f MB\n", 1e-6 * static_cast<double>(page.size()));
    EXPECT_EQ(count(page, "<image "), 12);
}

TEST(SystemReport, PageOfASensitivityStudy) {
    Command command;
    Sensitivity study;
    study.message = "2 of 3 runs ended well";
    study.parameters = {{"E", "materials.EW.E", "MPa", 40, 20, 80}};
    study.outputs = {{"peak force", "N"}};
    study.indices = {{"peak force", "E", "local", 0.5, 0.4, 0.6, "elasticity"},
                     {"peak force", "E", "local", nothing, nothing, nothing, "derivative"}};
    study.runs = {{{40}, {1}, "finished", 1}, {{41}, {2}, "finished", 1}, {{42}, {nothing}, "failed <hard>", 1}};
    write(study, command.path("study.h5"));
    const std::string page = report(command, "study.h5");
    for (const char* part :
         {"0.4 to 0.6", "<td>N / (MPa)</td>", "<td>local</td>", "2 of 3 runs ended well", "failed &lt;hard&gt;", "elasticity"})
        EXPECT_TRUE(contains(page, part)) << part;
    EXPECT_FALSE(contains(page, "nan"));
}

TEST(SystemReport, PageOfASpecimen) {
    Command command;
    Specimen specimen;
    specimen.rows = specimen.columns = 1;
    specimen.label = {Specimen::void_label};
    write(specimen, command.path("nothing.h5"));
    EXPECT_TRUE(contains(report(command, "nothing.h5"), "<title>nothing.h5</title>"));
    specimen.columns = 60;
    specimen.rows = 40;
    specimen.pixel = 25e-6;
    specimen.classes = {"EW", "LW <dark>"};
    for (int i = 0; i < 60 * 40; ++i) specimen.label.push_back(i % 60 >= 40);
    specimen.label.resize(60 * 40);
    specimen.label[0] = Specimen::void_label;
    specimen.density.assign(60 * 40, 400);
    specimen.orientation.assign(60 * 40, 0.1f);
    specimen.borders = {{3, {{10, 0}, {11, 39}}}, {4, {{50, 0}, {51, 39}}}};
    specimen.rings = {{4, 40, 0.3125}};
    specimen.source = "/a/folder/block.png";
    write(specimen, command.path("specimen.h5"));
    const std::string page = report(command, "specimen.h5");
    for (const char* part : {"<title>block.png</title>", "60 x 40 pixels, 25 um", "LW &lt;dark&gt;", "33.3 % of the picture",
                             "No wood", "2 borders, 1 rings between two of them", "x [px]", "ring borders", "radial direction",
                             "Density [kg/m³]", "<td class=\"number\">0.312</td>", "Width [mm]", ">1<"})
        EXPECT_TRUE(contains(page, part)) << part;
    EXPECT_EQ(count(page, "<image "), 2);
}

TEST(SystemReport, PageOfDisplacementFields) {
    Command command;
    FieldSeries series;
    series.reference = "shots/reference & more.png";
    series.lattice = {30, 20, 15, 15, 10};
    series.subset = 31;
    series.pixel = 1e-5;
    for (int i = 0; i < 60; ++i) series.images.push_back(fmt::format("shots/image_{}.png", i));
    std::mt19937 random(1);
    std::normal_distribution<double> noise(0, 1);
    write_fields(
        series,
        [&](int image) {
            DisplacementField field;
            for (auto column : {&DisplacementField::u, &DisplacementField::v, &DisplacementField::exx, &DisplacementField::eyy,
                                &DisplacementField::exy, &DisplacementField::zncc, &DisplacementField::sigma})
                for (int i = 0; i < 600; ++i) (field.*column).push_back(i < image ? nothing : noise(random));
            field.status.resize(600, PointStatus::ok);
            std::fill_n(field.status.begin(), image, PointStatus::moved_apart);
            return std::optional(field);
        },
        command.path("field.h5"));
    const std::string page = report(command, "field.h5");
    for (const char* part : {"Displacements against reference &amp; more.png", "<dd>60</dd>", "30 x 20, 10 pixels apart",
                             "Image 60 of 60: image_59.png, 90.2 % of the points followed", "moved apart (59)", "u [px]"})
        EXPECT_TRUE(contains(page, part)) << part;
    EXPECT_EQ(count(page, "<p data-frame="), 24);
    EXPECT_EQ(count(page, "<image "), 5 * 24);
    EXPECT_EQ(count(page, "class=\"shown last\""), 1 + 5);
}

TEST(SystemReport, PageOfACrackTrack) {
    Command command;
    CrackTrack track;
    track.reference = "reference.png";
    track.images = {"a.png", "b.png", "c.png"};
    track.columns = 300;
    track.rows = 200;
    track.tips = {{},
                  {TipStatus::ok, {100, 90}, 0.1, 100.5, 2, {{0, 80}, {50, 85}, {100, 90}}},
                  {TipStatus::ok, {150, 95}, 0.1, 150.5, 1.5}};
    write(track, command.path("pixels.h5"));
    std::string page = report(command, "pixels.h5");
    for (const char* part :
         {"Crack in reference.png", "found in 2 of 3 images", "size not known", "Crack length [px]", "no crack", "150.5"})
        EXPECT_TRUE(contains(page, part)) << part;
    track.pixel = 1e-5;
    track.time = {0, 1, 2};
    track.force = {0, 5, nothing};
    track.displacement = {0, 1e-4, nothing};
    write(track, command.path("track.h5"));
    page = report(command, "track.h5");
    for (const char* part : {"Crack length [mm]", "Displacement [mm]", "Force [N]", "Time [s]", "1.505"})
        EXPECT_TRUE(contains(page, part)) << part;
}

// Random stresses on fine points are what compresses worst.
TEST(SlowReport, PageOfManyFineFramesStaysSmall) {
    Command command;
    Record record;
    constexpr int edge = 440;
    for (int i = 0; i < edge * edge; ++i) record.point_position.emplace_back(1e-4 * (i % edge), 1e-4 * (i / edge));
    record.point_latewood.assign(record.point_position.size(), 0.5f);
    std::mt19937 random(1);
    std::normal_distribution<float> stress(0, 1e6f);
    for (int frame = 0; frame < 45; ++frame) {
        Frame& made = record.frames.emplace_back();
        made.time = frame;
        made.moved.assign(record.point_position.size(), Eigen::Vector2f::Zero());
        for (std::size_t i = 0; i < record.point_position.size(); ++i) made.stress.emplace_back(stress(random), 0, 0, 0);
    }
    write(record, command.path("large.h5"));
    const std::string page = report(command, "large.h5");
    std::printf("page of 40 noisy frames of %d points: %.2f MB\n", edge * edge, 1e-6 * static_cast<double>(page.size()));
    EXPECT_EQ(count(page, "<p data-frame="), 40);
}

TEST(SystemReport, RefusesWhatItCannotReportAndNeverHarmsItsInput) {
    Command command;
    write(small_fit(), command.path("fit.h5"));
    command.folder.write("scene.toml", small_scene);
    const std::string before = command.folder.read("fit.h5");
    const auto refused = [&](const std::string& file, const std::string& output, const std::string& why) {
        const Outcome outcome = command.run({"report", command.path(file), "-o", command.path(output)});
        EXPECT_EQ(outcome.status, 2) << file;
        EXPECT_TRUE(contains(outcome.error, why)) << outcome.error;
    };
    refused("absent.h5", "page.html", "does not exist");
    refused("scene.toml", "page.html", "HDF5");
    refused("fit.h5", "fit.h5", "must not be a file that is read");
    refused("fit.h5", "no/such/folder/page.html", "folder");
    EXPECT_EQ(command.run({"report", command.path("fit.h5"), "-o", command.path("page.html"), "--set", "a=1"}).status, 2);
    EXPECT_EQ(command.folder.read("fit.h5"), before);
    EXPECT_FALSE(std::filesystem::exists(command.path("page.html")));
}

// The slider, which is hidden from who has no scripts, is shown by the script; the console stays empty.
TEST(SystemReport, PageRunsInABrowserWithoutAWordOnTheConsole) {
    if (std::system("command -v chromium > /dev/null") != 0)
        GTEST_SKIP() << "needs chromium";  // a browser is no part of what scripts/setup installs
    Command command;
    command.folder.write("scene.toml", hostile_scene());
    ASSERT_EQ(command.run({"simulate", command.path("scene.toml"), "-o", command.path("record.h5")}).status, 0);
    ASSERT_TRUE(contains(report(command, "record.h5"), "<div class=\"slider\" hidden=\"hidden\">"));
    const std::string browse =
        "timeout 60 chromium --headless --no-sandbox --disable-gpu --disable-quic --no-first-run "
        "--disable-background-networking --disable-component-update --disable-sync --enable-logging=stderr "
        "--v=0 --user-data-dir='{0}/profile' --dump-dom 'file://{0}/page.html' > '{0}/dom.html' 2> '{0}/log.txt'";
    ASSERT_EQ(std::system(fmt::format(fmt::runtime(browse), command.path("")).c_str()), 0);
    EXPECT_TRUE(contains(command.folder.read("dom.html"), "<div class=\"slider\"><label>"));
    EXPECT_TRUE(contains(command.folder.read("dom.html"), "aria-valuetext=\"Frame "));
    EXPECT_FALSE(contains(command.folder.read("log.txt"), "CONSOLE")) << command.folder.read("log.txt");
    // A fit's page: all its pictures are drawn.
    write(small_fit(), command.path("fit.h5"));
    report(command, "fit.h5");
    ASSERT_EQ(std::system(fmt::format(fmt::runtime(browse), command.path("")).c_str()), 0);
    EXPECT_EQ(count(command.folder.read("dom.html"), "<image "), 5);
    EXPECT_FALSE(contains(command.folder.read("log.txt"), "CONSOLE")) << command.folder.read("log.txt");
}
