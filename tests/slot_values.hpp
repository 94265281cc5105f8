#pragma once
// Cached values as floats, of every SlotType.

#include <cstring>
#include <span>
#include <vector>

#include "core/ocl/buffer.hpp"
#include "core/stages/slot_type.hpp"

namespace isowave::core::test {

/// The voxel type of the same values.
inline VoxelType voxel_type_of(SlotType type) {
  switch (type) {
    case SlotType::kFloat32:
      return VoxelType::kFloat32;
    case SlotType::kInt8:
      return VoxelType::kInt8;
    case SlotType::kUint16:
      return VoxelType::kUint16;
    case SlotType::kInt16:
      return VoxelType::kInt16;
    default:
      return VoxelType::kUint8;
  }
}

/// The values of a buffer.
inline std::vector<float> slot_values(const ocl::Buffer<SlotValue> &buffer,
                                      SlotType type = SlotType::kFloat32) {
  const std::vector<SlotValue> bytes = buffer.read();
  return with_voxel_type(voxel_type_of(type), [&]<class T>(T) {
    std::vector<T> values(bytes.size() / sizeof(T));
    std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
    return std::vector<float>(values.begin(), values.end());
  });
}

/// The bytes of float slots.
inline std::vector<SlotValue> float_slots(std::span<const float> values) {
  std::vector<SlotValue> bytes(values.size_bytes());
  std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

/// Fills all slots with one value.
inline void fill_slots(ocl::Buffer<SlotValue> &buffer, SlotType type, float value) {
  with_voxel_type(voxel_type_of(type), [&]<class T>(T) {
    const std::vector<T> values(buffer.size() / sizeof(T), static_cast<T>(value));
    std::vector<SlotValue> bytes(buffer.size());
    std::memcpy(bytes.data(), values.data(), bytes.size());
    buffer.write(bytes);
  });
}

}  // namespace isowave::core::test
