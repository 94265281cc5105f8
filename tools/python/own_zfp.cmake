# Run when the package is installed: -D folder=<the package> -D zfp=<libzfp.so> -D nm=<nm>
# -D patchelf=<patchelf>. Gives the package a libzfp of its own, whose names nobody else has.
#
# libcfitsio, which ParaView loads, exports stream_open, stream_close, stream_flush and stream_size,
# as does libzfp. The dynamic linker takes the first that a process loaded, for calls from libisowave
# and from within libzfp alike. As Debian has no static libzfp, both get new names after linking:
# stream_open becomes isowave_stream_open.
cmake_minimum_required(VERSION 3.25)  # a script has no policies of its own

execute_process(COMMAND ${nm} -D --defined-only ${zfp}
                OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[^ \n]+\n" names "${symbols}")
if(NOT names)
  message(FATAL_ERROR "${zfp} exports nothing")
endif()
set(map "")
foreach(name IN LISTS names)
  string(STRIP ${name} name)
  string(APPEND map "${name} isowave_${name}\n")
endforeach()
set(map_file ${folder}/zfp_names.txt)
file(WRITE ${map_file} "${map}")

file(COPY_FILE ${zfp} ${folder}/libisowave_zfp.so)
get_filename_component(linked ${zfp} REALPATH)
execute_process(COMMAND ${patchelf} --print-soname ${linked} OUTPUT_VARIABLE soname
                OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${patchelf} --rename-dynamic-symbols ${map_file}
                        --set-soname libisowave_zfp.so ${folder}/libisowave_zfp.so
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${patchelf} --rename-dynamic-symbols ${map_file}
                        --replace-needed ${soname} libisowave_zfp.so ${folder}/libisowave.so
                COMMAND_ERROR_IS_FATAL ANY)
file(REMOVE ${map_file})
