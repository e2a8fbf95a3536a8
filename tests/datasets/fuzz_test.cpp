// Whatever stands in a scene, it is read or refused with an InputError that says why.
#include "datasets/error.hpp"
#include "datasets/io.hpp"
#include "tests/datasets/good_scenes.hpp"
#include "tests/temporary_folder.hpp"

#include <gtest/gtest.h>

#include <array>
#include <random>

using namespace crampfit;

namespace {

/// Spoils scenes; the same seed spoils them in the same way, since only the generator's raw bits are used.
class Mutator {
  public:
    explicit Mutator(unsigned seed) : random_(seed) {}

    std::string mutated_scene() {
        std::string text = scene();
        for (std::size_t count = 1 + below(2) * below(3); count > 0 && !text.empty(); --count) {
            mutate(text);
        }
        return text;
    }

  private:
    std::size_t below(std::size_t end) { return random_() % end; }

    const std::string& scene() {
        const std::array<const std::string*, 4> scenes{&ring_scene, &picture_scene, &plain_scene, &remembering_scene};
        return *scenes[below(scenes.size())];
    }

    void mutate(std::string& text) {
        // Numbers and quoted words come up more often: what they spoil gets past the TOML parser.
        switch (below(16)) {
        case 0:
            text[below(text.size())] = static_cast<char>(below(256));
            break;
        case 1:
            text.erase(below(text.size()), 1 + below(20));
            break;
        case 2:
            duplicate_line(text);
            break;
        case 3:
            text.insert(below(text.size()), 1, "[]{}\"'=,.#\n-+e0"[below(15)]);
            break;
        case 4:
            text.resize(below(text.size()));
            break;
        case 5:
            swap_token(text, " \n");
            break;
        case 6:
        case 7:
        case 8:
            replace_number(text);
            break;
        default:
            swap_token(text, "\"");
            break;
        }
    }

    void duplicate_line(std::string& text) {
        const std::size_t begin = text.rfind('\n', below(text.size())) + 1;  // npos + 1 is 0, the first line
        const std::string line = text.substr(begin, text.find('\n', begin) - begin) + '\n';
        text.insert(text.rfind('\n', below(text.size())) + 1, line);
    }

    void replace_number(std::string& text) {
        static constexpr std::array numbers{"0",          "-1",   "1e308", "1e-320", "nan",   "-inf", "99999999999999999999",
                                            "0x7f",       "1_0",  "255",   "0.5",    "1e999", "",     "25",
                                            "1979-05-27", "true", "1e5 5"};
        static constexpr const char* digits = "0123456789";
        const std::size_t begin = text.find_first_of(digits, below(text.size()));
        if (begin != std::string::npos) {
            const std::size_t end = text.find_first_not_of("0123456789.e", begin);
            text.replace(begin, end == std::string::npos ? end : end - begin, numbers[below(numbers.size())]);
        }
    }

    /// A random run of characters between two of these signs.
    std::pair<std::size_t, std::size_t> token(const std::string& text, const char* signs) {
        const std::size_t begin =
            text.find_first_not_of(signs, std::min(text.find_first_of(signs, below(text.size())), text.size()));
        if (begin == std::string::npos) {
            return {0, 0};
        }
        return {begin, std::min(text.find_first_of(signs, begin), text.size()) - begin};
    }

    void swap_token(std::string& text, const char* signs) {
        const std::string& other = scene();
        const auto [from, from_size] = token(other, signs);
        const auto [to, to_size] = token(text, signs);
        text.replace(to, to_size, other.substr(from, from_size));
    }

    std::mt19937 random_;
};

}  // namespace

TEST(UnitFuzz, MutatedScenesAreReadOrRefused) {
    const TemporaryFolder folder;
    folder.write("block.png", "");
    folder.write("angles.png", "");
    Mutator mutator(20070412);
    int read = 0;
    int refused_for_syntax = 0;
    int refused_for_meaning = 0;
    for (int i = 0; i < 10'000; ++i) {
        const std::string text = mutator.mutated_scene();
        SCOPED_TRACE("scene " + std::to_string(i) + ":\n" + text);
        try {
            parse_scene(text, folder / "scene.toml");
            ++read;
        } catch (const InputError& error) {
            ASSERT_EQ(error.file, (folder / "scene.toml").string());
            ASSERT_FALSE(error.rule.empty());
            ++(error.key.empty() ? refused_for_syntax : refused_for_meaning);
        } catch (const std::exception& error) {
            FAIL() << "another exception: " << error.what();
        }
    }
    // The mutations must reach behind the TOML parser, and must not all be harmful. Measured: 700, 5700, 3600.
    EXPECT_GT(read, 300);
    EXPECT_GT(refused_for_syntax, 1000);
    EXPECT_GT(refused_for_meaning, 1000);
}

TEST(UnitFuzz, OverridesAreTakenOrRefused) {
    const std::array<std::string, 24> parts{"model", "cell",   "edges",          "grip",    "0",      "velocity",
                                            "1",     "bodies", "left wheel",     "circle",  "radius", "materials",
                                            "EW",    "E",      "specimen",       "cutouts", "size",   "\"",
                                            "'x'",   "",       "\"left wheel\"", "-1",      "title",  "99999999999999999999"};
    const std::array<std::string, 12> values{"1 mm",         "0",     "[1, 2]", "{ a = 1 }", "",  "\"5 m/s\"",
                                             "x = 1\ny = 2", "\n[b]", "nan",    "\xff",      "'", "[\"1 mm\", \"2 mm\"]"};
    std::mt19937 random(7);
    int refused = 0;
    for (int i = 0; i < 3000; ++i) {
        std::string key = parts[random() % parts.size()];
        for (auto more = random() % 4; more > 0; --more) {
            key += "." + parts[random() % parts.size()];
        }
        const std::string value = values[random() % values.size()];
        SCOPED_TRACE(key + " = " + value);
        try {
            parse_scene(ring_scene, "scene.toml", {{key, value}});
        } catch (const InputError& error) {
            ASSERT_FALSE(error.rule.empty());
            ASSERT_FALSE(error.file.empty());
            ++refused;
        } catch (const std::exception& error) {
            FAIL() << "another exception: " << error.what();
        }
    }
    EXPECT_GT(refused, 2000) << "hardly any of these makes sense";
    EXPECT_LT(refused, 3000) << "some do";
}
