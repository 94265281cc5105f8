#pragma once
// Whether a device computes as the host does. Pictures have the same bits everywhere only if the
// operations of kernels_cl/portable/arithmetic.h have.

#include <span>
#include <string>
#include <vector>

#include "core/ocl/device.hpp"
#include "kernels_cl/portable/arithmetic.h"

namespace isowave::core::ocl {

/// The operands of the self-test: always the same, chosen so that each known mistake shows.
std::vector<Operands> arithmetic_operands();

/// The kinds of operations whose results are not those that the host computes: "division (28 % of
/// results)"; empty: none. results [operands].
std::vector<std::string> differences(std::span<const Operands> operands,
                                     std::span<const Results> results);

struct Computed {
  std::vector<Results> results;     ///< [operands]
  std::uint32_t largest_group = 0;  ///< work-items that a group of the kernel may have
};

/// Has a device compute the operands. A few milliseconds; waits.
///
/// Throws  Error: the kernel does not build, or the device fails
Computed compute_on(Device &device, std::span<const Operands> operands);

/// Result of a device's self-test.
struct SelfTest {
  std::string notice;  ///< one line on what it computes otherwise than the host, or nothing
  /// Work-items of a group. The self-test's kernel is as small as a kernel can be: none may have
  /// larger groups.
  std::uint32_t largest_group = 0;
};

/// A process tests each device once.
///
/// Throws  as compute_on()
SelfTest self_test(Device &device);

/// The notices of self_test() so far, each once.
std::vector<std::string> arithmetic_notices();

}  // namespace isowave::core::ocl
