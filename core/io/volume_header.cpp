#include "core/io/volume_header.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/text_header.hpp"

namespace isowave::core {

void set_axis(VolumeInfo &info, int axis, double spacing, const glm::dvec3 &direction) {
  info.spacing[axis] = std::abs(spacing);
  info.direction[axis] =
      (spacing < 0 ? -direction : direction) + 0.0;  // no negative zeros in what people read
}

std::optional<double> millimetres_in(std::string_view unit) {
  constexpr std::array<std::pair<std::string_view, double>, 21> kUnits{
      {{"m", 1e3},        {"meter", 1e3},       {"metre", 1e3},
       {"cm", 10},        {"centimeter", 10},   {"centimetre", 10},
       {"mm", 1},         {"millimeter", 1},    {"millimetre", 1},
       {"um", 1e-3},      {"\u00b5m", 1e-3},  // micro
       {"\u03bcm", 1e-3},                     // mu
       {"micron", 1e-3},  {"micrometer", 1e-3}, {"micrometre", 1e-3},
       {"nm", 1e-6},      {"nanometer", 1e-6},  {"nanometre", 1e-6},
       {"in", 25.4},      {"inch", 25.4},       {"km", 1e6}}};
  std::string name = lower_case(trim(unit));
  if (name.size() > 4 && name.ends_with('s')) name.pop_back();  // microns
  for (const auto &[known, millimetres] : kUnits) {
    if (name == known) return millimetres;
  }
  return {};
}

std::vector<double> millimetres_in(std::span<const std::string> units, std::string_view field,
                                   const std::string &what, VolumeHeader &header) {
  constexpr std::array<std::string_view, 5> kNone{"", "???", "?", "none", "unknown"};
  std::vector<double> result;
  bool converts = false;
  std::string names, unknown;
  for (const std::string &unit : units) {
    const std::optional<double> millimetres = millimetres_in(unit);
    result.push_back(millimetres.value_or(1.0));
    converts = converts || result.back() != 1.0;
    if (names.find(unit) == std::string::npos) names += (names.empty() ? "" : ", ") + unit;
    if (!millimetres && std::ranges::find(kNone, lower_case(unit)) == kNone.end()) unknown = unit;
  }
  if (!unknown.empty()) {
    header.notices.push_back(
        fmt::format("{}: {} {}: not a known unit of lengths: its numbers are taken for millimetres",
                    what, field, quote(unknown)));
  }
  if (converts) {
    header.notices.push_back(
        fmt::format("{}: lengths are converted to millimetres; {}: {}", what, field, names));
  }
  return result;
}

std::shared_ptr<const InputFile> open_data_file(const InputFile &header, const std::string &name) {
  const std::string what = fmt::format("{}: its data file {}", header.what(), quote(name));
  // Opening a name with a zero byte would open what is named before that.
  if (name.find('\0') != name.npos) throw Error("{}: no file can have this name", what);
  return std::make_shared<const InputFile>(header.path().parent_path() / name, what);
}

}  // namespace isowave::core
