# Run by embed_kernels(): -D output=<file.cpp> -D folder=<kernels_cl> -D kernels=<a.cl;b.cl>.
cmake_minimum_required(VERSION 3.25)  # a script has no policies of its own

# Appends `file` to `result` with each `#include "x.h"` replaced, the first time, by that header's
# text. As a compiler with -I<folder> does, looks beside the file first, then in the folder.
function(expand file)
  file(RELATIVE_PATH name ${folder} ${file})
  get_filename_component(beside ${file} DIRECTORY)
  file(READ ${file} text)
  # Brackets and semicolons would be taken as CMake list syntax.
  string(REPLACE "[" "@OPEN@" text "${text}")
  string(REPLACE "]" "@CLOSE@" text "${text}")
  string(REPLACE ";" "@SEMICOLON@" text "${text}")
  string(REPLACE "\\\n" "@CONTINUED@\n" text "${text}")
  string(REPLACE "\n" ";" lines "${text}")
  string(APPEND result "#line 1 \"${name}\"\n")
  set(line_number 0)
  foreach(line IN LISTS lines)
    math(EXPR line_number "${line_number} + 1")
    if(line MATCHES "^#include \"([a-z0-9_/]+\\.h)\"")
      set(header ${beside}/${CMAKE_MATCH_1})
      if(NOT EXISTS ${header})
        set(header ${folder}/${CMAKE_MATCH_1})
      endif()
      if(NOT header IN_LIST included)
        list(APPEND included ${header})
        expand(${header})
      endif()
      math(EXPR next_line "${line_number} + 1")
      string(APPEND result "#line ${next_line} \"${name}\"\n")
    else()
      string(APPEND result "${line}\n")
    endif()
  endforeach()
  set(result "${result}" PARENT_SCOPE)
  set(included "${included}" PARENT_SCOPE)
endfunction()

set(table "")
foreach(kernel IN LISTS kernels)
  get_filename_component(stem ${kernel} NAME_WE)
  set(result "")
  set(included "")
  expand(${kernel})
  string(REPLACE "@CONTINUED@" "\\" result "${result}")
  string(REPLACE "@OPEN@" "[" result "${result}")
  string(REPLACE "@CLOSE@" "]" result "${result}")
  string(REPLACE "@SEMICOLON@" ";" result "${result}")
  # Compilers limit the length of one literal (C++ promises 65,536 characters): adjacent pieces are
  # joined. And what they count at compile time: the suffix of the last piece knows the length.
  string(LENGTH "${result}" length)
  set(pieces "")
  set(begin 0)
  while(begin LESS length)
    string(SUBSTRING "${result}" ${begin} 12000 piece)
    string(APPEND pieces "\nR\"~kernel~(${piece})~kernel~\"")
    math(EXPR begin "${begin} + 12000")
  endwhile()
  string(APPEND table "    {\"${stem}\", ${pieces}sv},\n")
endforeach()

file(WRITE ${output} "// Made by tools/cmake/embed_kernels.cmake.
#include \"core/ocl/kernel_sources.hpp\"

namespace isowave::core::ocl {

using std::string_view_literals::operator\"\"sv;

std::span<const KernelSource> kernel_sources() {
  static constexpr KernelSource sources[] = {
${table}  };
  return sources;
}

}  // namespace isowave::core::ocl
")
