# Run by embed_kernels(): -D output=<file.cpp> -D folder=<kernels_cl> -D files=<a.cl;b.h>, and
# -D headers=<folder> for the C++ types of the kernels.
cmake_minimum_required(VERSION 3.25)  # a script has no policies of its own
include(${CMAKE_CURRENT_LIST_DIR}/kernel_signatures.cmake)

set(table "")
set(kernel_names "")
foreach(file IN LISTS files)
  file(RELATIVE_PATH name ${folder} ${file})
  file(READ ${file} text)
  # Comments at ends of lines are left out, a third of the bytes; lines keep their numbers.
  string(REGEX REPLACE "[ \t]*//[^\n]*" "" text "${text}")
  if(headers AND name MATCHES "\\.cl$")
    write_kernel_signatures(${name} "${text}" ${headers})
  endif()
  # Compilers limit the length of one literal (C++ promises 65,536 characters): adjacent pieces are
  # joined. And what they count at compile time: the suffix of the last piece knows the length.
  string(LENGTH "${text}" length)
  set(pieces "")
  set(begin 0)
  while(begin LESS length)
    string(SUBSTRING "${text}" ${begin} 12000 piece)
    string(APPEND pieces "\nR\"~kernel~(${piece})~kernel~\"")
    math(EXPR begin "${begin} + 12000")
  endwhile()
  string(APPEND table "    {\"${name}\", ${pieces}sv},\n")
endforeach()

file(WRITE ${output} "// Made by tools/cmake/embed_kernels.cmake.
#include \"core/ocl/kernel_sources.hpp\"

namespace isowave::core::ocl {

using std::string_view_literals::operator\"\"sv;

std::span<const KernelFile> kernel_files() {
  static constexpr KernelFile files[] = {
${table}  };
  return files;
}

}  // namespace isowave::core::ocl
")
