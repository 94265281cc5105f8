#include "core/sources/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <string_view>
#include <system_error>
#include <utility>

#include "core/base/error.hpp"
#include "core/platform/matching_files.hpp"
#include "core/platform/threads.hpp"
#include "core/zfp/zfp_file.hpp"

namespace isowave::core {

namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}

/// Takes the digits that a text begins with, without leading zeros.
std::string_view take_number(std::string_view &text) {
  const std::size_t length =
      static_cast<std::size_t>(std::ranges::find_if_not(text, is_digit) - text.begin());
  std::string_view number = text.substr(0, length);
  text.remove_prefix(length);
  number.remove_prefix(std::min(number.find_first_not_of('0'), number.size()));
  return number;
}

/// Natural order: numbers in names by their values. Names that differ by zeros alone are ordered by
/// their characters.
bool comes_before(const std::string &a, const std::string &b) {
  std::string_view x = a, y = b;
  while (!x.empty() && !y.empty()) {
    if (is_digit(x.front()) && is_digit(y.front())) {
      const std::string_view of_x = take_number(x), of_y = take_number(y);
      if (of_x.size() != of_y.size()) return of_x.size() < of_y.size();
      if (of_x != of_y) return of_x < of_y;
    } else {
      if (x.front() != y.front()) return x.front() < y.front();
      x.remove_prefix(1);
      y.remove_prefix(1);
    }
  }
  if (x.empty() != y.empty()) return x.empty();
  return a < b;
}

std::vector<SeriesStep> one_each(const std::vector<std::string> &paths) {
  std::vector<SeriesStep> steps(paths.size());
  std::ranges::transform(paths, steps.begin(),
                         [](const std::string &path) { return SeriesStep{path}; });
  return steps;
}

/// notices  gets VolumeReader::notices()
VolumeInfo info_of(const SeriesStep &step, const RawOverrides &overrides,
                   std::vector<std::string> &notices) {
  if (!is_zfp_name(step.path)) {
    const auto reader = open_any_volume(step.path, overrides, {}, step.step);
    notices = reader->notices();
    return reader->info();
  }
  if (overrides.dims || overrides.type)
    throw Error("{}: dims and type are for raw files", step.path);
  check_has_step(step.path, overrides.step);
  VolumeInfo info = read_zfp_file_info(step.path).info;
  if (overrides.spacing) info.spacing = *overrides.spacing;
  return info;
}

/// Throws  Error: a step cannot take the place of the first
void check_same_grid(const VolumeInfo &first, const std::string &first_name,
                     const VolumeInfo &other, const std::string &name) {
  if (other.dims != first.dims)
    throw Error("{} has {}x{}x{} voxels, but {} has {}x{}x{}: a series has one grid", name,
                other.dims.x, other.dims.y, other.dims.z, first_name, first.dims.x, first.dims.y,
                first.dims.z);
  constexpr double kRounding = 1e-5;  // of headers that are written as float32 or as text
  const auto differ = [&](const glm::dvec3 &a, const glm::dvec3 &b, const glm::dvec3 &unit) {
    return glm::any(glm::greaterThan(glm::abs(a - b), kRounding * unit));
  };
  const auto text = [](const glm::dvec3 &v) { return fmt::format("{} {} {}", v.x, v.y, v.z); };
  if (differ(other.spacing, first.spacing, first.spacing))
    throw Error("{} has a spacing of {}, but {} has {}: a series has one grid", name,
                text(other.spacing), first_name, text(first.spacing));
  const glm::dvec3 extent(glm::length(first.index_to_world() * glm::dvec3(first.dims)));
  const bool is_turned = differ(other.direction[0], first.direction[0], glm::dvec3(1)) ||
                         differ(other.direction[1], first.direction[1], glm::dvec3(1)) ||
                         differ(other.direction[2], first.direction[2], glm::dvec3(1));
  if (is_turned || differ(other.origin, first.origin, extent))
    throw Error("{} lies elsewhere than {}: a series has one grid", name, first_name);
}

}  // namespace

std::string SeriesStep::what() const {
  return step ? fmt::format("{}, step {}", path, *step) : path;
}

bool is_pattern(const std::string &path) {
  std::error_code failure;
  return !path.starts_with(kGenerate) && path.find_first_of("*?[") != path.npos &&
         !std::filesystem::exists(path, failure);
}

std::vector<SeriesStep> find_steps(const std::string &path) {
  if (is_pattern(path)) {
    std::vector<std::string> names = platform::matching_files(path);
    if (names.empty()) throw Error("{}: no file has such a name", path);
    std::ranges::sort(names, comes_before);
    return one_each(names);
  }
  if (path.starts_with(kGenerate) || is_zfp_name(path)) return {};
  std::vector<SeriesStep> steps;
  for (std::uint32_t step = 0; step < num_steps(path).value_or(0); ++step)
    steps.push_back({path, step});
  return steps;
}

std::vector<SeriesStep> steps_of_files(const std::vector<std::string> &paths) {
  if (paths.empty()) throw Error("a series without a file: give some");
  std::vector<SeriesStep> steps;
  if (paths.size() == 1) steps = find_steps(paths.front());
  return steps.empty() ? one_each(paths) : steps;
}

Series::Series(std::vector<SeriesStep> steps, const RawOverrides &overrides, Storage storage)
    : steps_(std::move(steps)), overrides_(overrides), storage_(std::move(storage)) {
  if (steps_.empty()) throw Error("a series without a file: give some");
  const SeriesStep &first = steps_.front();
  info_ = info_of(first, overrides_, notices_);
  std::vector<std::string> ignored;
  for (const SeriesStep &step : steps_) {
    if (step.path != first.path)
      check_same_grid(info_, first.what(), info_of(step, overrides_, ignored), step.what());
  }
}

Series::~Series() = default;  // waits for the thread

CompressedVolume Series::open(std::size_t index) {
  if (index >= size()) throw Error("step {} of a series of {}: count from 0", index, size());
  if (prepared_ != index) return load(index);
  prepared_.reset();
  return next_.get();
}

void Series::prepare(std::size_t index) {
  if (index >= size() || prepared_ == index) return;
  prepared_ = index;
  next_ = std::async(platform::kBeside, [this, index] { return load(index); });
}

CompressedVolume Series::load(std::size_t index) const {
  const SeriesStep &step = steps_.at(index);
  if (is_zfp_name(step.path)) return open_compressed_volume(step.path, overrides_);
  const OpenReader open = [&] { return open_any_volume(step.path, overrides_, {}, step.step); };
  try {
    return compress_volume(open, step.what(), storage_);
  } catch (const Error &error) {
    if (std::string_view(error.what()).starts_with(step.path)) throw;
    throw Error("{}: {}", step.what(), error.what());
  }
}

}  // namespace isowave::core
