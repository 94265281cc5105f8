#include "tools/isowave/render_series.hpp"

#include <fmt/format.h>

#include <filesystem>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/base/error.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/strict_options.hpp"

namespace isowave::core::tools {

namespace {

/// The numbers of the steps that --steps asks for.
///
/// text   FIRST, FIRST:LAST or FIRST:LAST:STRIDE; empty: all
/// count  steps of the series
std::vector<std::size_t> parse_steps(const std::string &text, std::size_t count) {
  std::vector<std::uint64_t> numbers;
  for (std::string_view rest = text; !text.empty() && numbers.size() < 4;) {
    const std::size_t end = rest.find(':');
    const std::optional<std::uint64_t> number = parse_whole(rest.substr(0, end));
    if (!number) throw Error("--steps {}: give FIRST:LAST or FIRST:LAST:STRIDE, from 0", text);
    numbers.push_back(*number);
    if (end == rest.npos) break;
    rest.remove_prefix(end + 1);
  }
  if (numbers.size() > 3) throw Error("--steps {}: give FIRST:LAST or FIRST:LAST:STRIDE", text);
  const std::uint64_t first = numbers.empty() ? 0 : numbers[0];
  const std::uint64_t last = numbers.size() > 1 ? numbers[1] : numbers.empty() ? count - 1 : first;
  const std::uint64_t stride = numbers.size() > 2 ? numbers[2] : 1;
  if (last >= count)
    throw Error("--steps {}: the series has {} steps, 0 to {}", text, count, count - 1);
  if (first > last) throw Error("--steps {}: the first step comes after the last", text);
  if (stride == 0) throw Error("--steps {}: a stride of 0: give 1 or more", text);
  std::vector<std::size_t> steps;
  for (std::uint64_t step = first; step <= last; step += std::min(stride, last - step + 1))
    steps.push_back(step);
  return steps;
}

}  // namespace

void find_series(const CLI::App &command, RenderArgs &options, const Team &team) {
  if (team.size() > 1) {
    if (is_pattern(options.input))
      throw Error("{}: with mpirun, all processes draw one volume: name one file", options.input);
  } else if (std::error_code failure;
             is_pattern(options.input) ||
             (options.volume.index.empty() && std::filesystem::exists(options.input, failure))) {
    options.series = find_steps(options.input);
  }
  if (options.series.empty()) {
    refuse_options(command, {"--steps"}, "VOLUME is no series: leave it out");
    return;
  }
  refuse_options(command, {"--save-scene"}, "a scene is one picture, and VOLUME is a series");
  const std::vector<SeriesStep> all = options.series;
  options.step_digits = std::to_string(all.size() - 1).size();
  options.steps = parse_steps(options.steps_text, all.size());
  options.series.clear();
  for (const std::size_t step : options.steps) options.series.push_back(all.at(step));
}

std::unique_ptr<Series> open_series(const RenderArgs &options) {
  if (options.series.empty()) return nullptr;
  Storage storage;
  for (const SeriesStep &step : options.series)
    storage = storage_for(step.path, options.frame.compression, nullptr);
  storage.progress = {};  // a thread at work beside the pictures has none
  auto series = std::make_unique<Series>(options.series, to_overrides(options.volume), storage);
  for (const std::string &notice : series->notices()) warn(notice);
  return series;
}

}  // namespace isowave::core::tools
