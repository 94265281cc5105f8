// `isowave compare A B`: two depth images (.npy) or two PNGs.

#include "core/accuracy/compare.hpp"

#include <fmt/format.h>

#include <array>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string_view>

#include "core/accuracy/flip.hpp"
#include "core/base/error.hpp"
#include "core/io/input_file.hpp"
#include "tools/isowave/commands.hpp"

namespace isowave::core::tools {
namespace {

struct CompareArgs {
  std::filesystem::path a, b;
  bool exact = false, json = false;
};

enum class ImageKind { kDepth, kColour };

/// Goes by the first bytes: a file's name may say anything.
ImageKind image_kind(const std::filesystem::path &path) {
  check_input_file(path);
  std::ifstream in(path, std::ios::binary);
  if (!in) throw Error("{}: cannot open", path.string());
  std::array<char, 6> first{};
  in.read(first.data(), first.size());
  const std::string_view magic(first.data(), static_cast<std::size_t>(in.gcount()));
  if (magic == "\x93NUMPY") return ImageKind::kDepth;
  if (magic.starts_with("\x89PNG")) return ImageKind::kColour;
  throw Error("{}: neither a .npy depth image nor a PNG", path.string());
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

/// Returns whether all bits are equal.
template <class Comparison>
bool report(const Comparison &result, bool as_json) {
  const bool equal = result.num_differing == 0;
  if (as_json) {
    fmt::print("{}\n", to_json(result).dump(2));
    return equal;
  }
  if (equal) {
    fmt::print("equal: all bits of {} pixels\n", result.num_pixels);
  } else {
    fmt::print("differing: {} of {} pixels\n", result.num_differing, result.num_pixels);
  }
  print(result);
  return equal;
}

void run_compare(const CompareArgs &args) {
  const ImageKind kind = image_kind(args.a);
  if (image_kind(args.b) != kind) {
    throw Error("{} and {}: one is a depth image, the other a PNG", args.a.string(),
                args.b.string());
  }
  const bool equal = kind == ImageKind::kDepth
                         ? report(compare_depth(read_npy(args.a), read_npy(args.b)), args.json)
                         : report(PictureComparison(read_png(args.a), read_png(args.b)), args.json);
  if (args.exact && !equal) throw CLI::RuntimeError(1);
}

}  // namespace

void add_compare(CLI::App &app) {
  const auto args = std::make_shared<CompareArgs>();
  CLI::App *command = app.add_subcommand("compare", "Compare two depth images (.npy) or two PNGs");
  command->add_option("A", args->a, "The true image, if one of the two is")->required();
  command->add_option("B", args->b, "The image under test")->required();
  command->add_flag("--exact", args->exact, "Exit with status 1 if any bit differs");
  command->add_flag("--json", args->json, "Print the result as JSON");
  command->callback([args] { run_compare(*args); });
}

}  // namespace isowave::core::tools
