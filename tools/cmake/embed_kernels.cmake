# embed_kernels(<target> <file.cl>...) makes an object library that holds the text of every kernel
# file, and of every header of kernels_cl. Nothing is read at run time; core/ocl/kernel_sources.hpp
# declares the lookup, and joins them. Each <stem>.cl also gives a header, "kernels/<stem>.hpp" for
# targets that link isowave_flags: the C++ types of its kernels (kernel_signatures.cmake).

set(embed_kernels_script ${CMAKE_CURRENT_LIST_DIR}/embed_kernels_script.cmake)
set(kernel_signatures ${CMAKE_CURRENT_LIST_DIR}/kernel_signatures.cmake)

function(embed_kernels target)
  set(folder_of_made ${CMAKE_CURRENT_BINARY_DIR}/generated)
  set(generated ${folder_of_made}/${target}.cpp)
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/kernels_cl)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${folder}/*.h)
  set(files ${ARGN} ${headers})
  set(signatures ${ARGN})
  list(TRANSFORM signatures REPLACE ".*/([a-z0-9_]+)\\.cl$" "${folder_of_made}/kernels/\\1.hpp")
  add_custom_command(
    OUTPUT ${generated}
    BYPRODUCTS ${signatures}
    COMMAND ${CMAKE_COMMAND} -D "output=${generated}" -D "folder=${folder}" -D "files=${files}"
            -D "headers=${folder_of_made}/kernels" -P ${embed_kernels_script}
    DEPENDS ${files} ${embed_kernels_script} ${kernel_signatures}
    COMMENT "Embedding OpenCL kernels" VERBATIM)
  add_library(${target} OBJECT ${generated})
  target_include_directories(isowave_flags INTERFACE ${folder_of_made})
  target_link_libraries(${target} PRIVATE isowave_flags)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
endfunction()
