/// arithmetic.cl -- the operations on which the bits of a picture depend, one by one. The host
/// compares what a device computes with its own results (core/ocl/arithmetic.hpp).
#include "portable/arithmetic.h"

/// In      operands [count]
/// Out     results [count]
/// Launch  grid-stride over the operands
kernel void arithmetic(global const Operands *operands, uint count, global Results *results) {
  for (uint i = get_global_id(0); i < count; i += get_global_size(0)) {
    const Operands given = operands[i];
    results[i] = compute(&given);
  }
}
