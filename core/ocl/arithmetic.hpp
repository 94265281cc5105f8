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

/// Has a device compute the operands. A few milliseconds; waits.
///
/// Throws  Error: the kernel does not build, or the device fails
std::vector<Results> compute_on(Device &device, std::span<const Operands> operands);

/// One line on what a device computes otherwise than the host, or nothing. A process asks each
/// device once.
///
/// Throws  as compute_on()
std::string arithmetic_notice(Device &device);

/// The lines of arithmetic_notice() so far, each once.
std::vector<std::string> arithmetic_notices();

}  // namespace isowave::core::ocl
