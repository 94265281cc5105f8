#pragma once
// The OpenCL C text of every file in kernels_cl, embedded at build time
// (tools/cmake/embed_kernels.cmake). Each file is there once: joining them is left to when a
// program is built, since nearly all kernels include the same headers.

#include <span>
#include <string>
#include <string_view>

namespace isowave::core::ocl {

struct KernelFile {
  std::string_view name;  ///< "radix_sort.cl", "portable/cubic.h": its path below kernels_cl
  std::string_view text;
};

/// All files.
std::span<const KernelFile> kernel_files();

/// The text of files[i], with each `#include "x.h"` replaced, the first time, by that header's
/// text. As a compiler with -I<kernels_cl> does, looks beside the file first, then at the top.
/// Before each part stands `#line 1 "name"`, so that a device compiler's message names the file and
/// line that a reader can open. Throws std::invalid_argument if a header is missing.
std::string join_kernel_file(std::span<const KernelFile> files, std::size_t i);

/// The joined text of the kernel file of that stem: "radix_sort" for
/// kernels_cl/paper/radix_sort.cl. Throws std::invalid_argument if there is none.
std::string kernel_text(std::string_view stem);

}  // namespace isowave::core::ocl
