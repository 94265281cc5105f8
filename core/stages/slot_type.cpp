#include "core/stages/slot_type.hpp"

#include <string>
#include <utility>

namespace isowave::core {

namespace {

const char *name_in_kernels(SlotType type) {
  switch (type) {
    case SlotType::kUint8:
    case SlotType::kGroups:
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

std::uint64_t value_bytes(SlotType type) {
  switch (type) {
    case SlotType::kUint16:
    case SlotType::kInt16:
      return 2;
    case SlotType::kFloat32:
      return 4;
    default:
      return 1;
  }
}

}  // namespace

std::uint64_t slot_bytes(SlotType type) {
  return ISO_BLOCK_VOXELS * value_bytes(type);
}

ocl::Defines with_labels(ocl::Defines defines, SlotType type) {
  if (type == SlotType::kGroups) defines.emplace("ISO_LABELS", "1");
  return defines;
}

ocl::Defines with_slots(ocl::Defines defines, SlotType type) {
  if (type == SlotType::kFloat32) return defines;  // as kernels are without macros
  defines.emplace("ISO_SLOT_VALUE", name_in_kernels(type));
  defines.emplace("ISO_SLOT_BITS", std::to_string(8 * value_bytes(type)) + "u");
  return with_labels(std::move(defines), type);
}

SlotType slot_type_for(std::span<const CompressedVolume *const> levels, bool with_bounds) {
  const CompressedVolume &volume = *levels.front();
  if (with_bounds || !volume.no_data.empty()) return SlotType::kFloat32;  // NaN: no data
  for (const CompressedVolume *level : levels) {
    if (!level->precision.whole_numbers) return SlotType::kFloat32;
  }
  switch (volume.info.type) {
    case VoxelType::kUint8:
      return SlotType::kUint8;
    case VoxelType::kInt8:
      return SlotType::kInt8;
    case VoxelType::kUint16:
      return SlotType::kUint16;
    case VoxelType::kInt16:
      return SlotType::kInt16;
    default:
      return SlotType::kFloat32;
  }
}

SlotType slot_type_for(const CompressedVolume &volume) {
  const CompressedVolume *const level = &volume;
  return slot_type_for({&level, 1}, false);
}

}  // namespace isowave::core
