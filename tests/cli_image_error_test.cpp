// `isowave render --max-image-error`.

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::quoted;
using test::run_isowave;
using test::TemporaryFolder;
using testing::HasSubstr;

test::ProgramResult render(const std::string &arguments) {
  test::ProgramResult result = run_isowave("render " + arguments);
  EXPECT_EQ(result.status, 0) << arguments << "\n" << result.out << result.err;
  return result;
}

TEST(CliImageError, IsKept) {
  const TemporaryFolder folder;
  const std::string volume =
      "generate:shell_64x64x64_uint8 -i 128 --size 160x120 --rate 8 --device host ";
  const auto draw = [&](const std::string &options, const std::string &name) {
    const auto run = render(volume + options + " --stats " + quoted(folder / "a.json") + " -o " +
                            quoted(folder / name));
    EXPECT_EQ(run.status, 0) << run.err;
    return std::pair(run, json::parse(test::read_file(folder / "a.json"))["frames"][0]["error"]);
  };
  const auto [run, error] = draw("--max-image-error 0.04", "a.png");
  EXPECT_THAT(run.out, HasSubstr("with 95 % confidence (Student's t), against 64 rays a pixel"));
  EXPECT_TRUE(error["reachable"].get<bool>());
  EXPECT_LE(error["flip"], error["highest_flip"]);
  EXPECT_LE(error["highest_flip"], 0.04);
  EXPECT_GE(error["tiles"], 24);
  EXPECT_LE(error["samples"], 4);
  EXPECT_EQ(error["tries"].back()["samples"], error["samples"]);
  // It is the picture that its rays and its detail give.
  draw(fmt::format("--levels all --samples {} --voxel-pixels {}", error["samples"].get<int>(),
                   error["voxel_pixels"].get<double>()),
       "b.png");
  EXPECT_EQ(test::read_file(folder / "a.png"), test::read_file(folder / "b.png"));

  const auto [one_ray, beyond] = draw("--max-image-error 1e-6 --samples 1", "c.png");
  EXPECT_FALSE(beyond["reachable"].get<bool>());
  EXPECT_THAT(one_ray.err, HasSubstr("allow more of them, up to 8 x 8"));
  const auto views =
      render(volume + "--orbit 2 --max-image-error 0.1 -o " + quoted(folder / "d.png"));
  EXPECT_THAT(views.out, HasSubstr("chosen for all views"));

  const std::string command = "render " + volume + " -o " + quoted(folder / "e.png") + " ";
  test::expect_one_line_error(command + "--max-image-error 2", "more than 0, up to 1");
  test::expect_one_line_error(command + "--max-image-error 0.1 --max-surface-error 1", "either");
  test::expect_one_line_error(command + "--max-image-error 0.1 --time-budget 9", "a time");
  test::expect_one_line_error(command + "--max-image-error 0.1 --voxel-pixels 1", "the detail");
  test::expect_one_line_error(command + "--max-image-error 0.1 --reference", "in full");
}

}  // namespace
}  // namespace isowave::core
