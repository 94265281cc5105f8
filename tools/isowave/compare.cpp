// `isowave compare A B`: two depth images (.npy), two PNGs, or two volumes.

#include "core/accuracy/compare.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>
#include <vector>

#include "core/accuracy/difference.hpp"
#include "core/accuracy/flip.hpp"
#include "core/api/frame_parts.hpp"
#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/file_name.hpp"
#include "core/io/input_file.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compare_volumes.hpp"
#include "tools/isowave/frame_options.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {
namespace {

struct CompareArgs {
  std::filesystem::path a, b;
  bool exact = false, json = false;
  std::string output, size;
  CompareVolumesOptions volumes;
};

enum class Kind { kDepth, kPicture, kVolume };

bool names_volume(const std::filesystem::path &path) {
  const std::string name = lower_case(path.filename().string());
  constexpr std::array kEndings{".raw", ".raw.gz", ".nrrd", ".nhdr",  ".mha",
                                ".mhd", ".nii",    ".zfp",  ".nii.gz"};
  return path.string().starts_with("generate:") ||
         std::ranges::any_of(kEndings, [&](const char *each) { return name.ends_with(each); });
}

/// Images go by their first bytes: a file's name may say anything.
Kind kind_of(const std::filesystem::path &path) {
  if (path.string().starts_with("generate:")) return Kind::kVolume;
  check_input_file(path);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error("{}: cannot open", path.string());
  std::array<char, 6> first{};
  in.read(first.data(), first.size());
  const std::string_view magic(first.data(), static_cast<std::size_t>(in.gcount()));
  if (magic == "\x93NUMPY") return Kind::kDepth;
  if (magic.starts_with("\x89PNG")) return Kind::kPicture;
  if (names_volume(path)) return Kind::kVolume;
  throw Error("{}: neither a .npy depth image, nor a PNG, nor a volume", path.string());
}

const char *words_for(Kind kind) {
  return kind == Kind::kDepth ? "a depth image" : kind == Kind::kPicture ? "a PNG" : "a volume";
}

void print(const DepthComparison &result) {
  fmt::print("hit in both: {}; only in A (false negatives): {}; only in B (false positives): {}\n",
             result.hit_both, result.false_negatives, result.false_positives);
  if (result.error) {
    fmt::print("depth |A-B| where both hit: p50 {:.6g}, p99 {:.6g}, max {:.6g}\n",
               result.error->p50, result.error->p99, result.error->max);
  }
}

/// With how different they look.
struct PictureComparison : ColourComparison {
  PictureComparison(const Image8 &a, const Image8 &b) : ColourComparison(compare_colour(a, b)) {
    if (num_differing != 0) flip = Flip(a).error(b);
  }
  double flip = 0;
};

void print(const PictureComparison &result) {
  if (!result.psnr_db) return;
  fmt::print("largest channel difference: {} of 255; PSNR: {:.2f} dB; FLIP: {:.4f}\n",
             result.max_channel_difference, *result.psnr_db, result.flip);
}

nlohmann::ordered_json to_json(const DepthComparison &result) {
  nlohmann::ordered_json json = {{"kind", "depth"},
                                 {"pixels", result.num_pixels},
                                 {"differing", result.num_differing},
                                 {"hit_both", result.hit_both},
                                 {"false_positives", result.false_positives},
                                 {"false_negatives", result.false_negatives},
                                 {"depth_error", nullptr}};
  if (result.error) {
    json["depth_error"] = {
        {"p50", result.error->p50}, {"p99", result.error->p99}, {"max", result.error->max}};
  }
  return json;
}

nlohmann::ordered_json to_json(const PictureComparison &result) {
  nlohmann::ordered_json json = {{"kind", "colour"},
                                 {"pixels", result.num_pixels},
                                 {"differing", result.num_differing},
                                 {"max_channel_difference", result.max_channel_difference},
                                 {"psnr_db", nullptr}};
  if (result.psnr_db) json["psnr_db"] = *result.psnr_db;
  json["flip"] = result.flip;
  return json;
}

void print(const VoxelComparison &result) {
  if (result.without_data_in_one != 0)
    fmt::print("without data in one volume alone: {}\n", result.without_data_in_one);
  fmt::print("|A-B| of voxels: largest {:.6g}, root mean square {:.6g}\n", result.max, result.rms);
}

nlohmann::ordered_json to_json(const VoxelComparison &result) {
  return {{"voxels", result.num_voxels},
          {"differing", result.num_differing},
          {"without_data_in_one", result.without_data_in_one},
          {"max_difference", result.max},
          {"rms_difference", result.rms}};
}

/// Prints a comparison, unless JSON is asked for. Returns whether all bits are equal.
///
/// count  of the things that are compared
template <class Comparison>
bool report(const Comparison &result, std::uint64_t count, const char *things, bool as_json) {
  const bool equal = result.num_differing == 0;
  if (as_json) return equal;
  if (equal) {
    fmt::print("equal: all bits of {} {}\n", count, things);
  } else {
    fmt::print("differing: {} of {} {}\n", result.num_differing, count, things);
  }
  print(result);
  return equal;
}

/// Half of the depths that differ by more than this part of them are of two cameras, not of one.
constexpr double kOtherCamera = 0.01;

/// Depth images say nothing of their cameras: a warning if they look like those of two.
void warn_of_cameras(const FloatImage &a, const DepthComparison &result) {
  if (!result.error) return;
  std::vector<float> depths;
  std::ranges::copy_if(a.pixels, std::back_inserter(depths),
                       [](float depth) { return std::isfinite(depth); });
  const auto middle = depths.begin() + std::ptrdiff_t(depths.size() / 2);
  std::ranges::nth_element(depths, middle);
  if (result.error->p50 > kOtherCamera * double{*middle})
    warn(
        fmt::format("half of the depths differ by {:.3g} or more: were both drawn from one "
                    "camera? (render --save-camera, --cameras)",
                    result.error->p50));
}

void warn_of_cameras(const std::filesystem::path &a, const std::filesystem::path &b) {
  const auto cameras_of = [](const std::filesystem::path &path) -> std::vector<Camera> {
    const std::optional<std::string> text = cameras_of_png(path);
    return text ? parse_camera_file(*text, path.string()).cameras : std::vector<Camera>{};
  };
  const std::vector<Camera> of_a = cameras_of(a), of_b = cameras_of(b);
  if (!of_a.empty() && !of_b.empty() && of_a != of_b)
    warn("the pictures were drawn from different cameras (render --save-camera, --cameras)");
}

/// Writes how two depth images differ.
void write_difference(const CompareArgs &args, const FloatImage &a, const FloatImage &b) {
  if (args.output.empty()) return;
  const DepthDifference difference = depth_difference(a, b);
  write_png(difference.picture, args.output);
  if (args.json) return;
  fmt::print(
      "wrote {}: blue, B is nearer; red, B is farther; full colours, |A-B| = {:.3g}; "
      "orange, only A is hit; black, only B is\n",
      args.output, difference.full);
}

bool compare_depths(const CompareArgs &args) {
  const FloatImage a = read_npy(args.a), b = read_npy(args.b);
  const DepthComparison result = compare_depth(a, b);
  const bool equal = report(result, result.num_pixels, "pixels", args.json);
  if (args.json) fmt::print("{}\n", to_json(result).dump(2));
  warn_of_cameras(a, result);
  write_difference(args, a, b);
  return equal;
}

bool compare_pictures(const CompareArgs &args) {
  const Image8 a = read_png(args.a), b = read_png(args.b);
  const PictureComparison result(a, b);
  const bool equal = report(result, result.num_pixels, "pixels", args.json);
  if (args.json) fmt::print("{}\n", to_json(result).dump(2));
  warn_of_cameras(args.a, args.b);
  if (args.output.empty()) return equal;
  write_png(picture_difference(a, b), args.output);
  if (!args.json) fmt::print("wrote {}: FLIP of each pixel, black is 0\n", args.output);
  return equal;
}

bool compare_two_volumes(const CompareArgs &args) {
  const ComparedVolumes both = compare_volumes(args.a, args.b, args.volumes);
  const DepthComparison depth = compare_depth(both.depth_a, both.depth_b);
  const PictureComparison picture(both.picture_a, both.picture_b);
  bool equal = both.voxels.has_value();
  if (both.voxels) equal &= report(*both.voxels, both.voxels->num_voxels, "voxels", args.json);
  if (!both.voxels && !args.json) fmt::print("voxels: not compared, A and B have other numbers\n");
  if (!args.json) fmt::print("isovalue {}, both from one camera:\n", both.isovalue);
  equal &= report(depth, depth.num_pixels, "depths", args.json);
  equal &= report(picture, picture.num_pixels, "pixels", args.json);
  write_difference(args, both.depth_a, both.depth_b);
  if (!args.json) return equal;
  const ImageSize &size = args.volumes.size;
  const std::string cameras = camera_file_text({core_camera(both.camera)}, size.width, size.height);
  nlohmann::ordered_json json = {{"kind", "volumes"},
                                 {"isovalue", both.isovalue},
                                 {"camera", nlohmann::ordered_json::parse(cameras)},
                                 {"voxels", nullptr},
                                 {"depth", to_json(depth)},
                                 {"picture", to_json(picture)}};
  if (both.voxels) json["voxels"] = to_json(*both.voxels);
  fmt::print("{}\n", json.dump(2));
  return equal;
}

void run_compare(const CLI::App &command, CompareArgs args) {
  const Kind kind = kind_of(args.a), other = kind_of(args.b);
  if (other != kind)
    throw Error("{} and {}: one is {}, the other {}", args.a.string(), args.b.string(),
                words_for(kind), words_for(other));
  if (kind != Kind::kVolume)
    refuse_options(command,
                   {"--isovalue", "--size", "--view", "--up", "--zoom", "--cameras", "--index"},
                   "is for volumes, which are drawn: leave it out");
  if (!args.volumes.cameras.empty())
    refuse_options(command, {"--view", "--up"}, "--cameras says from where: leave out either");
  if (!args.size.empty()) args.volumes.size = parse_size(args.size);
  check_image_size(args.volumes.size);
  Outputs outputs;
  for (const std::filesystem::path &path : {args.a, args.b}) {
    if (kind == Kind::kVolume) outputs.read_volume(path.string());
    if (kind != Kind::kVolume) outputs.read(path);
  }
  if (!args.volumes.cameras.empty()) outputs.read(args.volumes.cameras);
  if (!args.output.empty()) check_png_name(args.output);
  outputs.write("--output", args.output);
  const bool equal = kind == Kind::kDepth     ? compare_depths(args)
                     : kind == Kind::kPicture ? compare_pictures(args)
                                              : compare_two_volumes(args);
  if (args.exact && !equal) throw CLI::RuntimeError(1);
}

}  // namespace

void add_compare(CLI::App &app) {
  const auto args = std::make_shared<CompareArgs>();
  CLI::App *command = app.add_subcommand(
      "compare", "Compare two depth images (.npy), two PNGs, or a surface of two volumes");
  command->add_option("A", args->a, "The true one, if one of the two is")->required();
  command->add_option("B", args->b, "The one under test")->required();
  command->add_option(
      "--output,-o", args->output,
      "PNG of the difference: of PNGs FLIP's error, black is 0; else coolwarm, blue "
      "if B is nearer, red if it is farther, orange: only A is hit, black: only B");
  command->add_flag("--exact", args->exact, "Exit with status 1 if any bit differs");
  command->add_flag("--json", args->json, "Print the result as JSON");
  command
      ->add_option("--isovalue,-i", args->volumes.isovalue,
                   "Volumes: both are drawn at it, from one camera [the first that A suggests]")
      ->check(fits_float32());
  command->add_option("--size", args->size, "Volumes: picture size WxH [640x360]");
  add_side_options(*command, args->volumes.view);
  command->add_option("--cameras", args->volumes.cameras,
                      "Volumes: camera file, whose first camera is taken [A's box fills the "
                      "picture]");
  command
      ->add_option("--index", args->volumes.index,
                   "Volumes: which of NIfTI and NRRD files with a fourth axis, from 0, such as t=3")
      ->type_name("t=N");
  command->callback([command, args] { run_compare(*command, *args); });
}

}  // namespace isowave::core::tools
