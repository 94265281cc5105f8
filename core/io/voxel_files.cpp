#include "core/io/voxel_files.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <limits>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/text_header.hpp"
#include "core/io/volume_header.hpp"

namespace isowave::core {

namespace {

constexpr std::uint64_t kMostVoxels = std::uint64_t{1} << 56;
constexpr std::size_t kMostListed = std::size_t{1} << 20;
constexpr std::string_view kList = "LIST", kDigits = "0123456789", kWordEnds = " \t";

/// The place of a %d, or of one with a width as %03d: its begin and its end.
std::optional<std::array<std::size_t, 2>> find_number(std::string_view text) {
  for (std::size_t at = text.find('%'); at != text.npos; at = text.find('%', at + 1)) {
    const std::size_t end = text.find_first_not_of(kDigits, at + 1);
    if (end != text.npos && text[end] == 'd') return {{at, end + 1}};
  }
  return {};
}

void read_list(const HeaderFields &fields, std::string_view field, HeaderLines &lines,
               VoxelFileNames &names) {
  while (lines.next()) {
    const std::string_view line = trim(lines.line());
    if (line.empty()) break;
    if (lines.is_cut()) fields.fail(field, fmt::format("name {} is too long", names.count + 1));
    if (++names.count > kMostListed)
      fields.fail(field, fmt::format("more than {} names", kMostListed));
    names.list.emplace_back(line);
  }
  if (names.count == 0) fields.fail(field, "no names follow it");
}

/// FIRST LAST STEP: how many numbers that are.
std::uint64_t count_numbers(const HeaderFields &fields, std::string_view field, std::int64_t first,
                            std::int64_t last, std::int64_t step) {
  constexpr std::int64_t kFarthest = std::numeric_limits<std::int32_t>::max();
  for (const std::int64_t number : {first, last, step}) {
    if (number < -kFarthest || number > kFarthest)
      fields.fail(field, fmt::format("{} is too large", number));
  }
  if (step == 0 || (last - first) / step < 0 || (last != first && (last > first) != (step > 0)))
    fields.fail(field, "its step does not lead from the first number to the last");
  return static_cast<std::uint64_t>((last - first) / step) + 1;
}

}  // namespace

std::string VoxelFileNames::name(std::uint64_t index) const {
  if (!list.empty()) return list.at(index);
  const std::int64_t number = first + step * static_cast<std::int64_t>(index);
  const std::string digits = fmt::format("{}", std::abs(number));
  const std::string sign = number < 0 ? "-" : "";
  const std::size_t length = digits.size() + sign.size();
  const std::string filling(width > length ? width - length : 0, fill);
  return before + (fill == ' ' ? filling + sign : sign + filling) + digits + after;
}

std::optional<VoxelFileNames> read_voxel_file_names(const HeaderFields &fields,
                                                    std::string_view field, HeaderLines &lines) {
  const std::string_view value = fields[field];
  VoxelFileNames names;
  const auto read_axes = [&](std::string_view word) {
    names.num_axes = parse_integer(word);
    if (!names.num_axes) fields.fail(field, fmt::format("{} is no number of axes", quote(word)));
  };
  const std::vector<std::string_view> words = split_words(value);
  if (!words.empty() && words.front() == kList) {
    if (words.size() > 2) fields.fail(field, "need LIST, or LIST and a number of axes");
    if (words.size() == 2) read_axes(words.back());
    read_list(fields, field, lines, names);
    return names;
  }
  const auto place = find_number(value);
  if (!place) return {};
  const auto [begin, end] = *place;
  const std::size_t name_end = std::min(value.find_first_of(kWordEnds, end), value.size());
  const std::vector<std::string_view> numbers = split_words(value.substr(name_end));
  if (numbers.size() != 3 && numbers.size() != 4)
    fields.fail(field,
                "need a pattern and its first number, last number and step: s%03d.raw 0 9 1");
  names.before = value.substr(0, begin);
  names.after = value.substr(end, name_end - end);
  if (find_number(names.after)) fields.fail(field, "need one %d");
  const std::string_view digits = value.substr(begin + 1, end - begin - 2);
  constexpr std::uint32_t kWidest = 32;
  if (!digits.empty()) {
    const std::optional<std::int64_t> width = parse_integer(digits);
    if (!width || *width > kWidest)
      fields.fail(field, fmt::format("{} digits are too many", digits));
    names.width = static_cast<std::uint32_t>(*width);
    if (digits.front() == '0') names.fill = '0';
  }
  std::array<std::int64_t, 3> range{};
  for (std::size_t i = 0; i < range.size(); ++i) {
    const std::optional<std::int64_t> number = parse_integer(numbers[i]);
    if (!number) fields.fail(field, fmt::format("{} is no whole number", quote(numbers[i])));
    range.at(i) = *number;
  }
  names.first = range[0];
  names.step = range[2];
  names.count = count_numbers(fields, field, range[0], range[1], range[2]);
  if (numbers.size() == 4) read_axes(numbers[3]);
  return names;
}

VoxelFiles::VoxelFiles(std::shared_ptr<const InputFile> header, VoxelFileNames names,
                       std::span<const std::int64_t> sizes, std::string_view field)
    : header_(std::move(header)), names_(std::move(names)) {
  const std::int64_t num_axes = static_cast<std::int64_t>(sizes.size());
  const std::int64_t own_axes = names_.num_axes.value_or(num_axes - 1);
  if (own_axes < 1 || own_axes > num_axes)
    throw Error("{}: broken header: {}: files with {} {}, of an array with {}", header_->what(),
                field, own_axes, plural(own_axes, "axis", "axes"), num_axes);
  std::uint64_t num_voxels = 1, num_files = 1;
  for (std::int64_t axis = 0; axis < num_axes; ++axis) {
    std::uint64_t &product = axis < own_axes ? num_voxels : num_files;
    const auto size = static_cast<std::uint64_t>(sizes[static_cast<std::size_t>(axis)]);
    if (product > kMostVoxels / size)
      throw Error("{}: more voxels than files have", header_->what());
    product *= size;
  }
  if (own_axes == num_axes) {  // each file has a part of the slowest axis
    const auto slowest = static_cast<std::uint64_t>(sizes.back());
    if (slowest % names_.count != 0)
      throw Error("{}: broken header: {}: {} files, which cannot share an axis of {}",
                  header_->what(), field, names_.count, slowest);
    num_files = names_.count;
    num_voxels /= names_.count;
  }
  if (names_.count != num_files)
    throw Error("{}: broken header: {}: {} {}, need {}", header_->what(), field, names_.count,
                plural(names_.count, "file", "files"), num_files);
  voxels_each_ = num_voxels;
}

std::shared_ptr<const InputFile> VoxelFiles::open(std::uint64_t index) const {
  return open_data_file(*header_, names_.name(index));
}

}  // namespace isowave::core
