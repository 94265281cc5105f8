#include "core/stages/slot_type.hpp"

#include <string>

namespace isowave::core {

namespace {

const char *name_in_kernels(SlotType type) {
  switch (type) {
    case SlotType::kUint8:
      return "uchar";
    case SlotType::kInt8:
      return "char";
    case SlotType::kUint16:
      return "ushort";
    case SlotType::kInt16:
      return "short";
    default:
      return "float";
  }
}

}  // namespace

std::uint64_t slot_bytes(SlotType type) {
  return std::uint64_t{ISO_BLOCK_VOXELS} * size_of(type);
}

ocl::Defines with_slots(ocl::Defines defines, SlotType type) {
  if (type == SlotType::kFloat32) return defines;  // as kernels are without macros
  defines.emplace("ISO_SLOT_VALUE", name_in_kernels(type));
  defines.emplace("ISO_SLOT_BITS", std::to_string(8 * size_of(type)) + "u");
  return defines;
}

SlotType slot_type_for(std::span<const CompressedVolume *const> levels, bool with_bounds) {
  const CompressedVolume &volume = *levels.front();
  if (with_bounds || !volume.no_data.empty()) return SlotType::kFloat32;  // NaN: no data
  for (const CompressedVolume *level : levels) {
    if (!level->precision.whole_numbers) return SlotType::kFloat32;
  }
  const VoxelType type = volume.info.type;
  return is_integer(type) && size_of(type) <= 2 ? type : SlotType::kFloat32;
}

SlotType slot_type_for(const CompressedVolume &volume) {
  const CompressedVolume *const level = &volume;
  return slot_type_for({&level, 1}, false);
}

}  // namespace isowave::core
