# embed_kernels(<target> <file.cl>...) makes an object library that holds every kernel file, joined
# with the headers it includes, as one string each. Before each part stands `#line 1 "name"`, so a
# device compiler's message names the file and line that a reader can open. Nothing is read at run
# time; core/ocl/kernel_sources.hpp declares the lookup.

set(embed_kernels_script ${CMAKE_CURRENT_LIST_DIR}/embed_kernels_script.cmake)

function(embed_kernels target)
  set(generated ${CMAKE_CURRENT_BINARY_DIR}/generated/${target}.cpp)
  set(folder ${CMAKE_CURRENT_SOURCE_DIR}/kernels_cl)
  file(GLOB_RECURSE headers CONFIGURE_DEPENDS ${folder}/*.h)
  add_custom_command(
    OUTPUT ${generated}
    COMMAND ${CMAKE_COMMAND} -D "output=${generated}" -D "folder=${folder}" -D "kernels=${ARGN}"
            -P ${embed_kernels_script}
    DEPENDS ${ARGN} ${headers} ${embed_kernels_script}
    COMMENT "Embedding OpenCL kernels" VERBATIM)
  add_library(${target} OBJECT ${generated})
  target_link_libraries(${target} PRIVATE isowave_flags)
  set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
endfunction()
