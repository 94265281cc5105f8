#include "tools/isowave/accuracy_report.hpp"

#include <fmt/format.h>

namespace isowave::core::tools {

nlohmann::ordered_json quantiles_json(const Quantiles &q) {
  return {{"p50", q.p50}, {"p99", q.p99}, {"max", q.max}};
}

void print_accuracy_header(std::string_view what) {
  fmt::print("{:<28} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}  {:<26} {}\n", what, "rays",
             "hits", "missed", "false", "cell", "place", "at faces", "unstable",
             "|dt| p50, p99, max [voxels]", "|f-iso|/|grad f| p99, max");
}

void print_accuracy(std::string_view name, const Accuracy &tally) {
  const Quantiles distance = quantiles(tally.distance), residual = quantiles(tally.residual);
  fmt::print(
      "{:<28} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8}  {:.1e}, {:.1e}, {:.1e}  {:.1e}, "
      "{:.1e}\n",
      name, tally.rays, tally.hits, tally.missed, tally.false_hits, tally.wrong_cells,
      tally.wrong_places, tally.at_faces, tally.unstable, distance.p50, distance.p99, distance.max,
      residual.p99, residual.max);
}

nlohmann::ordered_json accuracy_json(const Accuracy &tally) {
  return {{"rays", tally.rays},
          {"hits", tally.hits},
          {"missed", tally.missed},
          {"false", tally.false_hits},
          {"wrong_cells", tally.wrong_cells},
          {"wrong_places", tally.wrong_places},
          {"at_faces", tally.at_faces},
          {"unstable", tally.unstable},
          {"distance_voxels", quantiles_json(quantiles(tally.distance))},
          {"residual_voxels", quantiles_json(quantiles(tally.residual))}};
}

void print_clip_accuracy_header(std::string_view what) {
  fmt::print("{:<28} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}\n", what, "rays", "hits",
             "caps", "missed", "false", "kind", "place", "gradient", "undecided");
}

void print_clip_accuracy(std::string_view name, const ClipAccuracy &tally) {
  fmt::print("{:<28} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}\n", name, tally.rays,
             tally.hits, tally.caps, tally.missed, tally.false_hits, tally.wrong_kinds,
             tally.wrong_places, tally.wrong_gradients, tally.undecided);
}

nlohmann::ordered_json clip_accuracy_json(const ClipAccuracy &tally) {
  return {{"rays", tally.rays},
          {"hits", tally.hits},
          {"caps", tally.caps},
          {"missed", tally.missed},
          {"false", tally.false_hits},
          {"wrong_kinds", tally.wrong_kinds},
          {"wrong_places", tally.wrong_places},
          {"wrong_gradients", tally.wrong_gradients},
          {"undecided", tally.undecided}};
}

void print_layer_accuracy_header(std::string_view what) {
  fmt::print(
      "{:<28} {:>9} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}\n",
      what, "rays", "hits", "caps", "most hits", "missed", "false", "order", "surface", "side",
      "kind", "place", "gradient", "undecided");
}

void print_layer_accuracy(std::string_view name, const LayerAccuracy &tally) {
  fmt::print(
      "{:<28} {:>9} {:>9} {:>9} {:>9} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>8} {:>9}\n",
      name, tally.rays, tally.hits, tally.caps, tally.most_hits, tally.missed, tally.false_hits,
      tally.wrong_order, tally.wrong_surfaces, tally.wrong_sides, tally.wrong_kinds,
      tally.wrong_places, tally.wrong_gradients, tally.undecided);
}

nlohmann::ordered_json layer_accuracy_json(const LayerAccuracy &tally) {
  return {{"rays", tally.rays},
          {"hits", tally.hits},
          {"caps", tally.caps},
          {"most_hits", tally.most_hits},
          {"missed", tally.missed},
          {"false", tally.false_hits},
          {"wrong_order", tally.wrong_order},
          {"wrong_surfaces", tally.wrong_surfaces},
          {"wrong_sides", tally.wrong_sides},
          {"wrong_kinds", tally.wrong_kinds},
          {"wrong_places", tally.wrong_places},
          {"wrong_gradients", tally.wrong_gradients},
          {"undecided", tally.undecided},
          {"cut", tally.cut}};
}

}  // namespace isowave::core::tools
