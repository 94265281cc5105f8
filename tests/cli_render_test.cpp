// `isowave render`, run as a user runs it: what it writes, and how it fails.

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <set>

#include "core/io/npy.hpp"
#include "core/io/png.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using nlohmann::json;
using test::quoted;
using test::run_isowave;
using test::TemporaryFolder;
using test::write_file;

const std::string kHead = ISOWAVE_TEST_DATA "/head_41x41x41_uint8.raw.gz";
const std::string kGyroid = "generate:gyroid_20x21x22_uint8";

std::set<std::string> names_in(const std::filesystem::path &folder) {
  std::set<std::string> names;
  for (const auto &entry : std::filesystem::directory_iterator(folder))
    names.insert(entry.path().filename().string());
  return names;
}

test::ProgramResult render(const std::string &arguments) {
  test::ProgramResult result = run_isowave("render " + arguments);
  EXPECT_EQ(result.status, 0) << arguments << "\n" << result.out << result.err;
  return result;
}

std::string camera_file(const char *dims = "[41,41,41]") {
  return std::string(R"({"dims":)") + dims +
         R"(,"spacing":[1,1,1],"width":40,"height":30,"fovy_deg":50,
    "cameras":[{"eye":[20,30,90],"at":[20,20,20],"up":[0,1,0]},
               {"eye":[80,20,20],"at":[20,20,20],"up":[0,1,0]}]})";
}

/// A budget that is too small is refused with the smallest that would do, which then does, with the
/// same bits.
TEST(CliRender, MemoryBudget) {
  const TemporaryFolder folder;
  const std::string command = kHead + " --isovalue 80 --size 64x48 --device cpu";
  const auto refused = run_isowave("render " + command + " --memory-budget 1KB");
  EXPECT_EQ(refused.status, 1);
  const std::string saying = "a memory budget of 1000 bytes is too small: ";
  const std::size_t at = refused.err.find(saying);
  ASSERT_NE(at, std::string::npos) << refused.err;
  const std::string least =
      refused.err.substr(at + saying.size(), refused.err.find(" would do") - at - saying.size());
  const auto drawn = render(command + " --verbose --memory-budget " + least + " --depth " +
                            quoted(folder / "least.npy"));
  EXPECT_NE(drawn.out.find("block cache"), std::string::npos) << drawn.out;
  render(command + " --depth " + quoted(folder / "ample.npy"));
  EXPECT_EQ(test::read_file(folder / "least.npy"), test::read_file(folder / "ample.npy"));
}

/// A stream on the host, also where the budget is smaller than it: the same picture.
TEST(CliRender, StreamOnTheHost) {
  const TemporaryFolder folder;
  const std::string file = quoted(folder / "n.zfp");
  ASSERT_EQ(run_isowave("convert " + kHead + " --rate 32 -o " + file).status, 0);
  const std::uint64_t stream_bytes = 11 * 11 * 11 * 256;
  const std::string command = file + " --isovalue 80 --size 40x30 --device cpu";
  const auto outputs = [&](const std::string &name) {
    return " -o " + quoted(folder / (name + ".png")) + " --depth " +
           quoted(folder / (name + ".npy")) + " --no-stage-times --stats " +
           quoted(folder / (name + ".json"));
  };
  const auto expect_same = [&](const std::string &name, const char *place) {
    for (const char *extension : {".png", ".npy"}) {
      EXPECT_EQ(test::read_file(folder / (name + extension)),
                test::read_file(folder / (std::string("device") + extension)))
          << name;
    }
    const json stats = json::parse(test::read_file(folder / (name + ".json")));
    EXPECT_EQ(stats["options"]["stream"], place);
    const json &frame = stats["frames"][0];
    std::uint64_t decoded = frame["normals"]["decoded_blocks"];
    for (const json &pass : frame["per_pass"])
      decoded += pass["decoded_blocks"].get<std::uint64_t>();
    EXPECT_EQ(frame["uploaded_blocks"], std::string_view(place) == "host" ? decoded : 0);
    EXPECT_EQ(frame["uploaded_bytes"], frame["uploaded_blocks"].get<std::uint64_t>() * 256);
    return stats;
  };
  render(command + outputs("device"));
  expect_same("device", "device");
  for (const char *pipeline : {"blocks", "rays"}) {
    const auto run =
        render(command + " --verbose --stream host --pipeline " + pipeline + outputs(pipeline));
    EXPECT_NE(run.out.find("stays on the host: as asked for"), std::string::npos) << run.out;
    expect_same(pipeline, "host");
  }
  const auto run = render(command + " --verbose --memory-budget 300kB" + outputs("tight"));
  EXPECT_NE(run.out.find("stays on the host: it does not fit"), std::string::npos) << run.out;
  const json stats = expect_same("tight", "host");
  EXPECT_LT(stats["memory"]["peak"], 300'000);
  EXPECT_LT(300'000u, stream_bytes) << "else this scene tests nothing";
  const auto cut = std::filesystem::file_size(folder / "n.zfp") / 2;
  std::filesystem::resize_file(folder / "n.zfp", cut);
  const auto refused = run_isowave("render " + command + " --stream host");
  EXPECT_EQ(refused.status, 1);
  EXPECT_EQ(std::count(refused.err.begin(), refused.err.end(), '\n'), 1) << refused.err;
  EXPECT_NE(refused.err.find("n.zfp: truncated"), std::string::npos) << refused.err;
}

TEST(CliRender, WritesPictureDepthStatisticsAndProgress) {
  const TemporaryFolder folder;
  const auto run = render(kHead + " --isovalue 80 --rate 8 --size 64x48 -o " +
                          quoted(folder / "a.png") + " --depth " + quoted(folder / "a.npy") +
                          " --stats " + quoted(folder / "a.json") + " --progress-dir " +
                          quoted(folder / "passes") + " --max-speculation 2 --pipeline blocks");
  EXPECT_NE(run.out.find("device "), std::string::npos) << run.out;
  EXPECT_NE(run.out.find("isovalue 80, view 0"), std::string::npos) << run.out;
  EXPECT_EQ(names_in(folder.path()), (std::set<std::string>{"a.png", "a.npy", "a.json", "passes"}));

  const Image8 picture = read_png(folder / "a.png");
  EXPECT_EQ(picture.width, 64u);
  EXPECT_EQ(picture.height, 48u);
  const FloatImage depth = read_npy(folder / "a.npy");
  EXPECT_EQ(depth.width, 64u);
  EXPECT_EQ(depth.height, 48u);
  const auto hits = std::count_if(depth.pixels.begin(), depth.pixels.end(), [](float t) {
    return t < std::numeric_limits<float>::infinity();
  });

  const json stats = json::parse(test::read_file(folder / "a.json"));
  ASSERT_EQ(stats["frames"].size(), 1u);
  const json &frame = stats["frames"][0];
  EXPECT_EQ(frame["isovalue"], 80);
  EXPECT_EQ(frame["view"], 0);
  EXPECT_EQ(frame["rays_hit"], hits);
  EXPECT_GT(hits, 300);
  EXPECT_GT(frame["total_ms"], 0.0);
  ASSERT_EQ(frame["passes"], frame["per_pass"].size());
  json hit_sum = 0;
  for (const json &pass : frame["per_pass"]) {
    for (const char *field :
         {"active_rays", "n_spec", "ray_block_pairs", "visible_blocks", "requested_blocks",
          "decoded_blocks", "rays_hit", "utilization_percent", "completed_percent"}) {
      ASSERT_TRUE(pass.contains(field)) << field;
      EXPECT_TRUE(pass[field].is_number()) << field;
    }
    for (const char *stage :
         {"traverse", "request", "cache", "decode", "group", "intersect", "composite"}) {
      EXPECT_TRUE(pass["stage_ms"].contains(stage)) << stage;
    }
    hit_sum = hit_sum.get<int>() + pass["rays_hit"].get<int>();
  }
  EXPECT_EQ(hit_sum, frame["rays_hit"]);
  EXPECT_EQ(frame["per_pass"].back()["completed_percent"], 100.0);
  EXPECT_EQ(stats["volume"]["dims"], (std::array{41, 41, 41}));
  EXPECT_EQ(stats["volume"]["rate"], 8.0);
  EXPECT_EQ(stats["options"]["size"], (std::array{64, 48}));
  EXPECT_EQ(stats["options"]["max_speculation"], 2);
  EXPECT_EQ(stats["options"]["cache_slots"], 11 * 11 * 11);
  EXPECT_EQ(stats["cache_slots"],
            json({{"first", 11 * 11 * 11}, {"last", 11 * 11 * 11}, {"most", 11 * 11 * 11}}));
  EXPECT_EQ(frame["per_pass"][0]["touched_blocks"], frame["per_pass"][0]["decoded_blocks"])
      << "of an empty cache";
  EXPECT_FALSE(stats["device"]["name"].get<std::string>().empty());
  std::uint64_t bytes = 0;
  for (const json &entry : stats["memory"]["by_name"])
    bytes += entry["current"].get<std::uint64_t>();
  EXPECT_EQ(bytes, stats["memory"]["current"]);
  EXPECT_GE(stats["memory"]["peak"], stats["memory"]["current"]);

  // The last pass' picture is the picture.
  std::set<std::string> passes;
  EXPECT_GT(frame["normals"]["passes"], 0);
  EXPECT_TRUE(frame["normals"]["stage_ms"].contains("normals"));
  const std::size_t num_passes =
      frame["passes"].get<std::size_t>() + frame["normals"]["passes"].get<std::size_t>();
  for (std::size_t i = 1; i <= num_passes; ++i) passes.insert(fmt::format("pass{:04}.png", i));
  EXPECT_EQ(names_in(folder / "passes"), passes);
  EXPECT_EQ(test::read_file(folder / "passes" / *passes.rbegin()),
            test::read_file(folder / "a.png"));
  EXPECT_NE(test::read_file(folder / "passes" / *passes.begin()),
            test::read_file(folder / "a.png"));
}

TEST(CliRender, NormalsOfBothKinds) {
  const TemporaryFolder folder;
  const auto picture = [&](const std::string &name, const std::string &options) {
    render(kHead + " -i 80 --size 48x40 --orbit 1 -o " + quoted(folder / (name + ".png")) +
           options);
    return test::read_file(folder / (name + ".png"));
  };
  const std::string smooth = picture("smooth", ""), cell = picture("cell", " --normals cell");
  EXPECT_EQ(picture("named", " --normals smooth"), smooth);
  EXPECT_NE(cell, smooth);
  EXPECT_EQ(picture("twin", " --normals cell --reference"), cell);
  const std::string depth =
      "render " + kHead + " -i 80 --size 48x40 --depth " + quoted(folder / "d.npy");
  EXPECT_EQ(run_isowave(depth + " --normals cell").status, 1) << "no picture shows them";
  EXPECT_EQ(run_isowave("render " + kHead + " -i 80 --normals flat").status, 1);
}

/// By --parallel, and by a camera file; the reference draws the same.
TEST(CliRender, ParallelProjection) {
  const TemporaryFolder folder;
  const std::string what = kHead + " -i 80 --size 40x30 ";
  const auto file = [&](const char *name) { return quoted(folder / name); };
  render(what + "--parallel -o " + file("a.png") + " --stats " + file("a.json"));
  render(what + "--parallel --reference -o " + file("b.png"));
  render(what + "-o " + file("c.png"));
  EXPECT_EQ(test::read_file(folder / "a.png"), test::read_file(folder / "b.png"));
  EXPECT_NE(test::read_file(folder / "a.png"), test::read_file(folder / "c.png"));
  const auto camera =
      nlohmann::json::parse(test::read_file(folder / "a.json"))["frames"][0]["camera"];
  EXPECT_GT(camera["parallel_height"], 0);
  nlohmann::json views = {{"fovy_deg", camera["fovy_deg"]}, {"cameras", {camera}}};
  test::write_file(folder / "v.json", views.dump());
  render(what + "--cameras " + file("v.json") + " -o " + file("d.png"));
  EXPECT_EQ(test::read_file(folder / "a.png"), test::read_file(folder / "d.png"));
  views["cameras"][0]["parallel_height"] = -1;
  test::write_file(folder / "v.json", views.dump());
  test::expect_one_line_error(
      "render " + what + "--cameras " + file("v.json") + " -o " + file("e.png"),
      "parallel projection");
}

TEST(CliRender, ReferenceIsTheSamePicture) {
  const TemporaryFolder folder;
  const auto outputs = [&](const std::string &name) {
    return " -i 60 -i 150 --orbit 2 --size 48x40 --spacing 1 2 1 --rate 3 --color '#4080C0' -o " +
           quoted(folder / (name + ".png")) + " --depth " + quoted(folder / (name + ".npy")) +
           " --stats " + quoted(folder / (name + ".json"));
  };
  render(kHead + outputs("device") + " --speculation off --cache-slots 300 --no-stage-times");
  const auto reference = render(kHead + outputs("twin") + " --reference");
  EXPECT_EQ(reference.out.find("device"), std::string::npos) << reference.out;
  for (const char *frame : {"_iso60_view0", "_iso60_view1", "_iso150_view0", "_iso150_view1"}) {
    for (const char *extension : {".png", ".npy"}) {
      const auto compare = run_isowave(
          "compare --exact " + quoted(folder / (fmt::format("device{}{}", frame, extension))) +
          " " + quoted(folder / (fmt::format("twin{}{}", frame, extension))));
      EXPECT_EQ(compare.status, 0) << frame << extension << "\n" << compare.out << compare.err;
      EXPECT_NE(compare.out.find("equal"), std::string::npos) << compare.out;
    }
  }
  const auto compare = run_isowave("compare --exact " + quoted(folder / "device_iso60_view0.npy") +
                                   " " + quoted(folder / "twin_iso60_view1.npy"));
  EXPECT_EQ(compare.status, 1);

  const json stats = json::parse(test::read_file(folder / "device.json"));
  ASSERT_EQ(stats["frames"].size(), 4u);
  std::size_t i = 0;
  for (const int isovalue : {60, 150}) {  // all views of each isovalue in turn
    for (const int view : {0, 1}) {
      EXPECT_EQ(stats["frames"][i]["isovalue"], isovalue);
      EXPECT_EQ(stats["frames"][i++]["view"], view);
    }
  }
  for (const json &pass : stats["frames"][0]["per_pass"]) {
    EXPECT_LE(pass["n_spec"], 1);
    EXPECT_FALSE(pass.contains("stage_ms"));
  }
  const json twin = json::parse(test::read_file(folder / "twin.json"));
  EXPECT_TRUE(twin["options"]["reference"]);
  for (std::size_t frame = 0; frame < 4; ++frame)
    EXPECT_EQ(twin["frames"][frame]["rays_hit"], stats["frames"][frame]["rays_hit"]);
}

TEST(CliRender, CameraFileGivesViewsAndSize) {
  const TemporaryFolder folder;
  write_file(folder / "c.json", camera_file());
  const std::string cameras = " --cameras " + quoted(folder / "c.json") + " -i 80 ";
  render(kHead + cameras + "--depth " + quoted(folder / "a.npy"));
  const FloatImage first = read_npy(folder / "a_iso80_view0.npy");
  EXPECT_EQ(first.width, 40u);
  EXPECT_EQ(first.height, 30u);
  EXPECT_NE(first.pixels, read_npy(folder / "a_iso80_view1.npy").pixels);
  render(kHead + cameras + "--size 20x10 --depth " + quoted(folder / "b.npy"));  // the option wins
  EXPECT_EQ(read_npy(folder / "b_iso80_view1.npy").width, 20u);
}

TEST(CliRender, ZfpFilesAndCompressionOnTheFlyAreTheSame) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_isowave("convert " + kHead + " --rate 5 -o " + quoted(folder / "n.zfp")).status, 0);
  render(quoted(folder / "n.zfp") + " -i 80 --size 32x32 --depth " + quoted(folder / "a.npy"));
  render(kHead + " --rate 5 -i 80 --size 32x32 --depth " + quoted(folder / "b.npy"));
  render(kHead + " --rate 4 -i 80 --size 32x32 --depth " + quoted(folder / "c.npy"));
  EXPECT_EQ(test::read_file(folder / "a.npy"), test::read_file(folder / "b.npy"));
  EXPECT_NE(test::read_file(folder / "a.npy"), test::read_file(folder / "c.npy"));
}

TEST(CliRender, ErrorsInsteadOfARate) {
  const TemporaryFolder folder;
  ASSERT_EQ(run_isowave("convert " + kHead + " --exact -o " + quoted(folder / "n.zfp")).status, 0);
  const auto depth = [&](const std::string &arguments) {
    render(arguments + " -i 80.5 --size 32x32 --depth " + quoted(folder / "a.npy"));
    return test::read_file(folder / "a.npy");
  };
  const std::string exact = depth(quoted(folder / "n.zfp"));
  EXPECT_EQ(depth(kHead + " --exact"), exact);
  EXPECT_EQ(depth(kHead + " --rate 32"), exact) << "as good as no compression";
  EXPECT_EQ(depth(quoted(folder / "n.zfp") + " --voxel-error 0.1"), exact)
      << "less than what was left out";
  const std::string coarse = depth(quoted(folder / "n.zfp") + " --voxel-error 20");
  EXPECT_NE(coarse, exact);
  EXPECT_EQ(depth(quoted(folder / "n.zfp") + " --voxel-error 20 --reference"), coarse);
  EXPECT_NE(depth(kHead + " --tolerance-relative 0.05"), exact);
  test::expect_one_line_error(
      "render " + kHead + " -i 80 --voxel-error -1 --depth " + quoted(folder / "b.npy"),
      "voxel error of -1");
  test::expect_one_line_error(
      "render " + kHead + " -i 80 --rate 4 --exact --depth " + quoted(folder / "b.npy"), "rate");
}

TEST(CliRender, LevelsOfDetail) {
  const TemporaryFolder folder;
  const std::string file = quoted(folder / "n.zfp");
  const auto converted = run_isowave("convert " + kHead + " --rate 16 --levels all -o " + file);
  ASSERT_EQ(converted.status, 0) << converted.err;
  EXPECT_NE(converted.out.find("level of detail 21x21x21"), std::string::npos) << converted.out;
  const json info = json::parse(run_isowave("info --json " + file).out);
  EXPECT_EQ(info["coarser"], json({{21, 21, 21}, {11, 11, 11}, {6, 6, 6}}));
  ASSERT_EQ(info["level_errors"].size(), 3u);
  EXPECT_GT(info["level_errors"][0], info["max_voxel_error"])
      << "against the finest level before compression";
  const auto depth = [&](const std::string &arguments) {
    render(arguments + " -i 80 --size 32x32 --no-stage-times --stats " + quoted(folder / "a.json") +
           " --depth " + quoted(folder / "a.npy"));
    return test::read_file(folder / "a.npy");
  };
  const std::string finest = depth(file), coarse = depth(file + " --voxel-pixels 1.5");
  const json stats = json::parse(test::read_file(folder / "a.json"));
  const json levels = stats["frames"][0]["levels"];
  EXPECT_LT(levels.at(0).get<int>(), levels.at(1).get<int>()) << "one level drew all";
  EXPECT_EQ(stats["options"]["voxel_pixels"], 1.5);
  EXPECT_NE(coarse, finest);
  EXPECT_EQ(depth(file + " --voxel-pixels 1.5 --reference"), coarse);
  EXPECT_EQ(depth(kHead + " --rate 16 --voxel-pixels 1.5"), coarse)
      << "levels are made when they are needed";
  EXPECT_EQ(depth(file + " --voxel-pixels 0"), finest);

  ASSERT_EQ(run_isowave("convert " + kHead + " --rate 4 -o " + file).status, 0);
  const std::string refused =
      "render " + file + " -i 80 --reference --depth " + quoted(folder / "b.npy");
  test::expect_one_line_error(refused + " --voxel-pixels 1", "no levels of detail");
  test::expect_one_line_error(refused + " --voxel-pixels -1", "a distance of -1 pixels");
  test::expect_one_line_error("convert " + kHead + " --levels 9 -o " + file, "9 levels of detail");
  test::expect_one_line_error("convert " + kHead + " --levels some -o " + file, "--levels");
}

TEST(CliRender, MaxError) {
  const TemporaryFolder folder;
  const std::string file = quoted(folder / "n.zfp"), map = quoted(folder / "e.npy");
  ASSERT_EQ(run_isowave("convert " + kHead + " --rate 16 --levels all -o " + file).status, 0);
  const auto error_of = [&](const std::string &arguments) {
    const auto run = render(arguments + " -i 80 --size 64x48 --no-stage-times --error-map " + map +
                            " --stats " + quoted(folder / "a.json"));
    EXPECT_NE(run.out.find("pixels of the true surface"), std::string::npos) << run.out;
    return json::parse(test::read_file(folder / "a.json"))["frames"][0]["error"];
  };
  const json error = error_of(file + " --max-surface-error 0.5");
  EXPECT_TRUE(error["reachable"].get<bool>());
  EXPECT_GT(error["certified"], 0.9 * error["pixels"].get<double>());
  EXPECT_GT(error["tries"].size(), 3u);
  EXPECT_LE(error["median"], error["p99"]);
  const FloatImage bounds = read_npy(folder / "e.npy");
  EXPECT_EQ(bounds.pixels.size(), 64u * 48);
  EXPECT_EQ(
      std::ranges::count_if(bounds.pixels, [](float bound) { return bound > 0 && bound <= 0.5f; }),
      error["certified"].get<int>());
  EXPECT_EQ(error_of(kHead + " --rate 16 --max-surface-error 0.5")["chosen"], error["chosen"])
      << "a volume that is compressed now";
  const json out_of_reach = error_of(kHead + " --rate 2 --max-surface-error 0.001");
  EXPECT_FALSE(out_of_reach["reachable"].get<bool>());
  EXPECT_EQ(out_of_reach["chosen"], json({{"voxel_pixels", 0.0}, {"voxel_error", 0.0}}));

  const std::string command = "render " + file + " -i 80 --depth " + quoted(folder / "b.npy");
  test::expect_one_line_error(command + " --max-surface-error 1 --reference",
                              "--reference draws every frame in full");
  test::expect_one_line_error(command + " --max-surface-error 0", "an error of 0 pixels");
  test::expect_one_line_error(command + " --max-surface-error 1 --voxel-error 1",
                              "leave out --voxel-error");
  test::expect_one_line_error(command + " --error-map " + map,
                              "--error-map needs --max-surface-error");
}

TEST(CliRender, MaxErrorBySample) {
  const TemporaryFolder folder;
  const std::string volume = "generate:shell_64x64x64_uint8 -i 128 --size 320x240 ";
  const auto error_of = [&](const std::string &error) {
    const auto run = render(volume + "--rate 8 --no-stage-times --by sample --stats " +
                            quoted(folder / "a.json") + " --max-surface-error " + error);
    EXPECT_EQ(run.out.find("% confidence (Clopper-Pearson)") != std::string::npos, error == "4");
    EXPECT_EQ(run.out.find("  full detail: ") != std::string::npos, error != "4") << run.out;
    return json::parse(test::read_file(folder / "a.json"))["frames"][0]["error"];
  };
  const json coarse = error_of("4");
  EXPECT_EQ(coarse["by"], "sample");
  EXPECT_GT(coarse["chosen"]["voxel_pixels"], 0);
  EXPECT_GE(coarse["lowest_share"], 0.99);
  EXPECT_EQ(coarse["confidence"], 0.95);
  EXPECT_GE(coarse["sampled_hits"], coarse["within"]);
  EXPECT_GT(coarse["sampled_rays"], coarse["sampled_hits"]);
  EXPECT_GT(coarse["tries"].size(), 3u);
  EXPECT_EQ(coarse["tries"][0]["within"], 1.0);
  EXPECT_EQ(error_of("0.00001")["chosen"], json({{"voxel_pixels", 0.0}, {"voxel_error", 0.0}}));

  // All views have the same detail.
  const auto views = render(volume + "--orbit 3 --rate 8 --by sample --max-surface-error 4 -o " +
                            quoted(folder / "c.png"));
  const std::string again = "chosen for all views";
  const std::size_t second = views.out.find(again), third = views.out.find(again, second + 1);
  EXPECT_LT(views.out.find("chosen in "), second) << views.out;
  EXPECT_NE(third, std::string::npos) << views.out;

  const std::string command = "render " + volume + " -o " + quoted(folder / "b.png") + " ";
  test::expect_one_line_error(command + "--max-surface-error 1 --by nonsense", "--by");
  test::expect_one_line_error(command + "--by sample", "--by sample needs --max-surface-error");
  test::expect_one_line_error(
      command + "--max-surface-error 1 --by sample --error-map " + quoted(folder / "e.npy"),
      "leave out --by sample");
}

TEST(CliRender, TimeBudget) {
  const TemporaryFolder folder;
  const std::string scene = kHead + " -i 80 --size 64x48 ";
  const auto picture = [&](const std::string &name) { return quoted(folder / (name + ".png")); };
  ASSERT_EQ(render(scene + "-o " + picture("plain")).status, 0);
  const auto run =
      render(scene + "--time-budget 0.001 -o " + picture("quick") + " --refined " +
             picture("refined") + " --no-stage-times --stats " + quoted(folder / "a.json"));
  EXPECT_EQ(run.status, 0) << run.err;
  const json frame = json::parse(test::read_file(folder / "a.json"))["frames"][0]["time_budget"];
  EXPECT_EQ(frame["budget_ms"], 0.001);
  EXPECT_FALSE(frame["complete"].get<bool>());
  ASSERT_EQ(frame["steps"].size(), 1u);
  EXPECT_EQ(frame["steps"][0]["size"], json({8, 6}));
  EXPECT_EQ(frame["steps"][0]["voxel_pixels"], 0.0) << "the finest level of detail draws all";
  const Image8 quick = read_png(folder / "quick.png"), plain = read_png(folder / "plain.png");
  EXPECT_EQ(quick.width, 64u);
  EXPECT_NE(quick.pixels, plain.pixels);
  EXPECT_EQ(read_png(folder / "refined.png").pixels, plain.pixels);
  ASSERT_EQ(render(scene + "--time-budget 1e9 -o " + picture("ample")).status, 0);
  EXPECT_EQ(read_png(folder / "ample.png").pixels, plain.pixels);
  ASSERT_EQ(render(scene + "--pipeline blocks --time-budget 1e9 -o " + picture("ample")).status, 0);
  EXPECT_EQ(read_png(folder / "ample.png").pixels, plain.pixels);

  const std::string command = "render " + scene + " -o " + picture("a") + " --time-budget ";
  test::expect_one_line_error(command + "0", "no picture can be drawn in 0 ms");
  test::expect_one_line_error(command + "nan", "--time-budget");
  test::expect_one_line_error(command + "9 --reference", "--reference draws every frame in full");
  test::expect_one_line_error(command + "9 --max-surface-error 1", "leave out --time-budget");
  test::expect_one_line_error(command + "9 --progress-dir " + quoted(folder / "p"),
                              "leave out --progress-dir");
  test::expect_one_line_error("render " + scene + " --refined " + picture("a"),
                              "--refined needs --time-budget");
}

TEST(CliRender, NegativeAndFractionalIsovalues) {
  const TemporaryFolder folder;
  std::vector<float> ramp(512);
  for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = float(i % 8) - 4.0f;
  write_file(folder / "r_8x8x8_float32.raw", ramp);
  const auto run =
      render("-i -1 " + quoted(folder / "r_8x8x8_float32.raw") +
             " --isovalue -1.5 -i -2e-1 --isovalue=-3 --size 24x16 --rate 16 --depth " +
             quoted(folder / "a.npy"));
  EXPECT_EQ(
      names_in(folder.path()),
      (std::set<std::string>{"r_8x8x8_float32.raw", "a_iso-1_view0.npy", "a_iso-1.5_view0.npy",
                             "a_iso-0.2_view0.npy", "a_iso-3_view0.npy"}));
  EXPECT_EQ(run.out.find(": 0 rays hit"), std::string::npos) << run.out;
}

TEST(CliRender, SeveralRaysAPixel) {
  const TemporaryFolder folder;
  const std::string frame = kHead + " -i 80 --size 40x30 --samples 3 ";
  render(frame + "-o " + quoted(folder / "a.png") + " --depth " + quoted(folder / "a.npy") +
         " --stats " + quoted(folder / "a.json"));
  const Image8 picture = read_png(folder / "a.png");
  EXPECT_EQ(picture.width, 40u);
  EXPECT_EQ(picture.height, 30u);
  render(frame + "--reference -o " + quoted(folder / "r.png"));
  EXPECT_EQ(read_png(folder / "r.png").pixels, picture.pixels);
  render(kHead + " -i 80 --size 120x90 --depth " + quoted(folder / "b.npy"));
  EXPECT_EQ(read_npy(folder / "a.npy").width, 120u);
  EXPECT_EQ(read_npy(folder / "a.npy").pixels, read_npy(folder / "b.npy").pixels)
      << "depth is each ray's";
  EXPECT_EQ(json::parse(test::read_file(folder / "a.json"))["options"]["samples"], 3);
}

TEST(CliRender, NothingHitIsABackgroundPicture) {
  const TemporaryFolder folder;
  const std::string said =
      render(kGyroid + " -i 1e9 --size 16x8 --background '#102030' -o " + quoted(folder / "a.png"))
          .err;
  EXPECT_NE(said.find("warning: isovalue 1000000000 is outside the volume's values, 0 to 255: "),
            std::string::npos)
      << said;
  const Image8 picture = read_png(folder / "a.png");
  for (std::size_t i = 0; i < picture.pixels.size(); ++i)
    ASSERT_EQ(picture.pixels[i], 0x10 * (i % picture.channels + 1));
}

/// Status 1, one line on stderr that begins with `isowave:` and says `text`.
void expect_refused(const std::string &arguments, std::string_view text) {
  SCOPED_TRACE("render " + arguments);
  const auto result = run_isowave("render " + arguments);
  EXPECT_EQ(result.status, 1);
  EXPECT_EQ(std::count(result.err.begin(), result.err.end(), '\n'), 1) << result.err;
  EXPECT_TRUE(result.err.starts_with("isowave: ")) << result.err;
  EXPECT_TRUE(result.err.ends_with('\n')) << result.err;
  EXPECT_NE(result.err.find(text), std::string::npos) << result.err;
  EXPECT_EQ(result.out.find("rays hit"), std::string::npos)
      << "refused before any work: " << result.out;
}

TEST(CliRender, BadOptionsAreOneLineAndLeaveNothing) {
  const TemporaryFolder out;
  const std::string good = kGyroid + " -i 128 --size 16x8 ";
  const std::string to = " -o " + quoted(out / "a.png") + " --depth " + quoted(out / "a.npy") +
                         " --stats " + quoted(out / "a.json");
  expect_refused(good + "--device nosuchdevice" + to, "nosuchdevice");
  expect_refused(good + "--device 99" + to, "99");
  expect_refused(good + "--samples 0" + to, "--samples");
  expect_refused(good + "--samples 9" + to, "--samples");
  expect_refused(kGyroid + " -i 128 --size 16384x8192 --samples 2" + to,
                 "an image of 16384 x 8192");
  expect_refused(quoted(out / "missing.raw") + " -i 1" + to, "no such file");
  expect_refused(quoted(out / "missing.zfp") + " -i 1" + to, "missing.zfp");
  expect_refused(kGyroid + " -i abc --size 16x8" + to, "isovalue");
  expect_refused(kGyroid + " -i nan --size 16x8" + to, "isovalue");
  expect_refused("-i 128" + to, "VOLUME");
  for (const char *size : {"0x0", "0x8", "16x0", "16", "x", "16x8x4", "-16x8", "16X8",
                           "99999999999x8", "40000x40000"}) {
    expect_refused(kGyroid + " -i 128 --size=" + size + to, "pixels");
  }
  expect_refused(good + "--cache-slots 7" + to, "cache-slots");
  expect_refused(good + "--cache-slots -1" + to, "cache-slots");
  expect_refused(good + "--max-speculation 0" + to, "1 to 64");
  expect_refused(good + "--max-speculation 65" + to, "1 to 64");
  expect_refused(good + "--speculation often" + to, "speculation");
  expect_refused(good + "--group-size 48" + to, "48");
  expect_refused(good + "--pipeline tube" + to, "pipeline");
  expect_refused(good + "--memory-budget much" + to, "memory-budget");
  expect_refused(good + "--grouping bubble" + to, "radix, counting");
  expect_refused(good + "--stream tape" + to, "stream");
  expect_refused(good + "--closest farthest" + to, "scan, atomic-min");
  expect_refused(good + "--orbit 0" + to, "orbit");
  expect_refused(good + "--orbit 2 --cameras x.json" + to, "orbit");
  expect_refused(good + "--rate 0" + to, "1 to 32");
  expect_refused(good + "--rate 33" + to, "1 to 32");
  expect_refused(good + "--spacing 0" + to, "spacing");
  expect_refused(good + "--color reddish" + to, "#RRGGBB");
  expect_refused(good + "--background '#12345g'" + to, "#RRGGBB");
  expect_refused(good + "--nonsense" + to, "nonsense");
  expect_refused(good + "--reference --progress-dir " + quoted(out / "p") + to, "--progress-dir");
  EXPECT_EQ(out.num_files(), 0u);
}

TEST(CliRender, BadCameraFilesAreOneLine) {
  const TemporaryFolder folder;
  const TemporaryFolder out;
  const auto with = [&](const std::string &text) {
    write_file(folder / "c.json", text);
    return kHead + " -i 80 --cameras " + quoted(folder / "c.json") + " -o " + quoted(out / "a.png");
  };
  expect_refused(with(camera_file("[41,41,42]")), "41x41x42");
  expect_refused(with(camera_file()) + " --spacing 1 1 2", "spacing");
  expect_refused(with("{"), "c.json");
  expect_refused(with(R"({"fovy_deg":60,"cameras":[]})"), "cameras");
  expect_refused(with(R"({"fovy_deg":60,"cameras":[{"eye":[0,0,0],"at":[0,0,0],"up":[0,1,0]}]})"),
                 "camera 0");
  expect_refused(with(R"({"fovy_deg":60,"cameras":[{"eye":[1e9,0,0],"at":[0,0,0],"up":[0,1,0]}]})"),
                 "eye");
  expect_refused(kHead + " -i 80 --cameras " + quoted(folder / "none.json"), "none.json");
  EXPECT_EQ(out.num_files(), 0u);
}

TEST(CliRender, UnwritableOutputsAreOneLine) {
  const TemporaryFolder folder;
  const std::string good = kGyroid + " -i 128 --size 16x8 ";
  for (const char *option : {"-o", "--depth", "--stats"}) {
    expect_refused(good + option + " " + quoted(folder / "missing" / "a.x"), "cannot write");
    expect_refused(good + option + " " + quoted(folder.path()), "cannot write");
  }
  write_file(folder / "file", std::string_view("old"));
  expect_refused(good + "--progress-dir " + quoted(folder / "file"), "cannot make the folder");
  EXPECT_EQ(names_in(folder.path()), (std::set<std::string>{"file"}));
  EXPECT_EQ(test::read_file(folder / "file"), "old");
}

}  // namespace
}  // namespace isowave::core
