#include "core/frame/labels.hpp"

#include "core/base/error.hpp"
#include "core/base/text.hpp"

namespace isowave::core {

LabelTable label_table(const std::vector<SurfaceStyle> &surfaces) {
  LabelTable table(ISO_NUM_LABELS);
  for (std::size_t i = 0; i < surfaces.size(); ++i) {
    for (const std::uint16_t label : surfaces[i].labels)
      table[label] = static_cast<std::uint8_t>(table[label] | 1u << i);
  }
  return table;
}

void check_labels(const CompressedVolume &volume) {
  if (!is_integer(volume.info.type))
    throw Error("voxels of type {} are no labels: give a volume of integers",
                to_string(volume.info.type));
  if (!volume.precision.is_reversible() && !volume.precision.whole_numbers)
    throw Error("the volume was compressed with a loss, and labels are exact: compress it without");
  if (!volume.no_data.empty())
    throw Error("{} {} no data, and each voxel has a label: give no value for them",
                volume.no_data.num_voxels(),
                plural(volume.no_data.num_voxels(), "voxel has", "voxels have"));
  const auto [least, most] = volume.value_range;
  if (!(least >= 0 && most < float{ISO_NUM_LABELS}))
    throw Error("the volume's values, {} to {}, are no labels: labels are 0 to {}", least, most,
                ISO_NUM_LABELS - 1);
}

bool are_labels(const CompressedVolume &volume) {
  try {
    check_labels(volume);
    return true;
  } catch (const Error &) {
    return false;
  }
}

}  // namespace isowave::core
