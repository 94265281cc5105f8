# embed_kernels(<target> <file.cl>...) makes an object library that holds the text of every kernel
# file, and of every header of kernels_cl. Nothing is read at run time; core/ocl/kernel_sources.hpp
# declares the lookup, and joins them.

set(embed_kernels_script ${CMAKE_CURRENT_LIST_DIR}/embed_kernels_script.cmake)

function(embed_kernels target)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/generated/${target}.cpp)
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/kernels_cl)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${folder}/*.h)
  set(files ${ARGN} ${headers})
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${CMAKE_COMMAND} -D "output=${generated}" -D "folder=${folder}" -D "files=${files}"
            -P ${embed_kernels_script}
    DEPENDS ${files} ${embed_kernels_script}
    COMMENT "Embedding OpenCL kernels" VERBATIM)
  add_library(${target} OBJECT ${generated})
  target_link_libraries(${target} PRIVATE isowave_flags)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
endfunction()
