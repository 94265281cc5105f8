#pragma once
// The type of the values in cache slots: a volume that has only the values of a short integer type
// takes a quarter or half of the memory, and of the cache lines, that float32 takes.

#include <cstdint>
#include <span>

#include "core/ocl/kernel.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// kGroups: bit masks of the groups of labels (kernels_cl/portable/label_table.h).
enum class SlotType : std::uint32_t {
  kFloat32 = ISO_SLOTS_FLOAT32,
  kUint8 = ISO_SLOTS_UINT8,
  kInt8 = ISO_SLOTS_INT8,
  kUint16 = ISO_SLOTS_UINT16,
  kInt16 = ISO_SLOTS_INT16,
  kGroups = ISO_SLOTS_GROUPS
};

/// A byte of a slot. Kernels read and write values of a SlotType (kernels_cl/device/slot_values.h).
struct SlotValue {
  std::uint8_t byte;
};

/// Bytes of a slot.
std::uint64_t slot_bytes(SlotType type);

/// Adds the macro of kernels that read ranges of blocks: ISO_LABELS, if slots have groups.
ocl::Defines with_labels(ocl::Defines defines, SlotType type);
/// Adds the macros of kernels that read or write cached values, and ISO_LABELS likewise.
ocl::Defines with_slots(ocl::Defines defines, SlotType type);

/// The smallest type that holds every value which blocks of these levels are decoded to, whatever
/// bit planes a frame leaves out.
///
/// with_bounds  bounds of blocks' errors are added to their values
SlotType slot_type_for(std::span<const CompressedVolume *const> levels, bool with_bounds);
SlotType slot_type_for(const CompressedVolume &volume);

}  // namespace isowave::core
