#include "core/zfp/isovalue_notice.hpp"

#include <fmt/format.h>

#include <cmath>

namespace isowave::core {

std::string isovalue_notice(const CompressedVolume &volume, float isovalue) {
  const auto [least, most] = volume.value_range;
  const bool is_known = std::isfinite(least) && std::isfinite(most);
  if (!is_known || (least < isovalue && isovalue <= most)) return {};
  return fmt::format("isovalue {} is {} the volume's values, {} to {}: there is no surface",
                     isovalue, isovalue == least ? "the least of" : "outside", least, most);
}

}  // namespace isowave::core
