#pragma once
// The OpenCL C text of every kernel file, embedded at build time (tools/cmake/embed_kernels.cmake).

#include <span>
#include <string_view>

namespace isowave::core::ocl {

struct KernelSource {
  std::string_view stem;  ///< "radix_sort" for kernels_cl/radix_sort.cl
  std::string_view text;  ///< the file with its headers, `#line` marks included
};

std::span<const KernelSource> kernel_sources();

}  // namespace isowave::core::ocl
