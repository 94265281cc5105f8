# Included by embed_kernels_script.cmake: C++ types of the kernels in one file. A kernel
#
#   kernel void scale_values(global const uint *input, uint factor, global uint *output) {
#
# gives, in <folder>/<stem>.hpp,
#
#   struct scale_values {
#     static constexpr const char *kStem = "launch_probe", *kName = "scale_values";
#     using Params = ocl::Params<ocl::In<uint> /* input */, ...>;
#   };
#
#   global const T *x, constant T *x   ocl::In<T>
#   global T *x, volatile global T *x  ocl::Out<T>, which the kernel may also read
#   local T *x                         ocl::Local<T>
#   T x, const T x                     T
#
# T is a scalar_type or a struct that host and device share. Behind `global` it may also
# be ISO_WORDS(S), a struct S read as words (portable/shared_types.h), which gives S, and void,
# which gives std::byte: the type of elements is chosen when the kernel is built.

set(scalar_type "uchar|ushort|uint|ulong|int|float")
set(struct_type "[A-Z][A-Za-z0-9]*")

# get_cpp_type(<parameter>): sets cpp_type, to "" if there is none, and cpp_struct, to "" or the
# struct that it names.
function(get_cpp_type param)
  set(value "${scalar_type}|${struct_type}")
  string(REGEX REPLACE "(global .*)ISO_WORDS\\((${struct_type})\\) \\*" "\\1\\2 *" param "${param}")
  if(param MATCHES "^(global const|constant) (${value}|void) \\*([a-z0-9_]+)$")
    set(type "ocl::In<%>")
  elseif(param MATCHES "^(volatile )?global (${value}|void) \\*([a-z0-9_]+)$")
    set(type "ocl::Out<%>")
  elseif(param MATCHES "^(local) (${value}) \\*([a-z0-9_]+)$")
    set(type "ocl::Local<%>")
  elseif(param MATCHES "^(const )?(${value}) ([a-z0-9_]+)$")
    set(type "%")
  else()
    set(cpp_type "" PARENT_SCOPE)
    return()
  endif()
  set(element ${CMAKE_MATCH_2})
  set(name ${CMAKE_MATCH_3})
  string(REGEX MATCH "^${struct_type}$" struct ${element})
  string(REPLACE "void" "std::byte" element ${element})
  string(REPLACE "%" ${element} type ${type})
  set(cpp_type "${type} /* ${name} */" PARENT_SCOPE)
  set(cpp_struct "${struct}" PARENT_SCOPE)
endfunction()

# write_kernel_signatures(<file.cl's name> <its text> <folder>): a header that stays as it is keeps
# its time, so that nothing is compiled again. Appends the kernels' names to `kernel_names`.
function(write_kernel_signatures name text folder)
  get_filename_component(stem ${name} NAME_WE)
  string(REGEX REPLACE "/\\*([^*]|\\*+[^*/])*\\*+/" "" text "${text}")
  string(REGEX REPLACE "[ \t\n]+" " " text "${text}")
  string(REGEX MATCHALL "(^|[^A-Za-z0-9])(__)?kernel[^A-Za-z0-9_]" words "${text}")
  string(REGEX MATCHALL "kernel (__attribute__\\(\\([^;{]*\\)\\) )?void [a-z0-9_]+\\([^;{]*\\) {"
         kernels "${text}")
  list(LENGTH words num_words)
  list(LENGTH kernels num_kernels)
  if(NOT num_words EQUAL num_kernels)
    message(FATAL_ERROR "  ${name}: a kernel is declared as `kernel void name(...) {`, with "
                        "attributes before `void`; ${num_kernels} of ${num_words} are")
  endif()
  set(structs "")
  set(signatures "")
  foreach(kernel IN LISTS kernels)
    string(REGEX MATCH "void ([a-z0-9_]+)\\((.*)\\) {$" kernel "${kernel}")
    set(kernel_name ${CMAKE_MATCH_1})
    string(REPLACE "," ";" params "${CMAKE_MATCH_2}")
    if(kernel_name IN_LIST kernel_names)
      message(FATAL_ERROR "  ${name}: kernel ${kernel_name}: another kernel has this name")
    endif()
    list(APPEND kernel_names ${kernel_name})
    if(params STREQUAL "void")
      set(params "")
    endif()
    set(types "")
    foreach(param IN LISTS params)
      string(STRIP "${param}" param)
      get_cpp_type("${param}")
      if(NOT cpp_type)
        message(FATAL_ERROR "  ${name}: kernel ${kernel_name}: no C++ type for the parameter "
                            "'${param}'; kernel_signatures.cmake lists those that have one")
      endif()
      list(APPEND types "\n      ${cpp_type}")
      list(APPEND structs ${cpp_struct})
    endforeach()
    list(JOIN types "," types)
    string(APPEND signatures "
struct ${kernel_name} {
  static constexpr const char *kStem = \"${stem}\", *kName = \"${kernel_name}\";
  using Params = ocl::Params<${types}>;
};
")
  endforeach()
  set(kernel_names ${kernel_names} PARENT_SCOPE)
  list(REMOVE_DUPLICATES structs)
  set(declared "")
  foreach(struct IN LISTS structs)
    string(APPEND declared "struct ${struct};\n")
  endforeach()
  set(header "#pragma once
// The kernels of kernels_cl/${name}. Made by tools/cmake/kernel_signatures.cmake.

#include \"core/ocl/kernel.hpp\"
#include \"kernels_cl/portable/shared_types.h\"

namespace isowave::core {

${declared}
namespace kernels {
${signatures}
}  // namespace kernels
}  // namespace isowave::core
")
  set(before "")
  if(EXISTS ${folder}/${stem}.hpp)
    file(READ ${folder}/${stem}.hpp before)
  endif()
  if(NOT header STREQUAL before)
    file(WRITE ${folder}/${stem}.hpp "${header}")
  endif()
endfunction()
