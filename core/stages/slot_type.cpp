#include "core/stages/slot_type.hpp"

#include <cstddef>
#include <string>

namespace isowave::core {

namespace {

struct SlotTypeEntry {
  const char *in_kernels;
  std::uint32_t bits;
};

constexpr SlotTypeEntry kSlotTypes[] = {
    {"float", 32}, {"uchar", 8}, {"char", 8}, {"ushort", 16}, {"short", 16}};

const SlotTypeEntry &entry_of(SlotType type) {
  return kSlotTypes[static_cast<std::size_t>(type)];
}

}  // namespace

std::uint64_t slot_bytes(SlotType type) {
  return std::uint64_t{ISO_BLOCK_VOXELS} * entry_of(type).bits / 8;
}

ocl::Defines with_slots(ocl::Defines defines, SlotType type) {
  if (type == SlotType::kFloat32) return defines;  // as kernels are without macros
  defines.emplace("ISO_SLOT_VALUE", entry_of(type).in_kernels);
  defines.emplace("ISO_SLOT_BITS", std::to_string(entry_of(type).bits) + "u");
  return defines;
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
