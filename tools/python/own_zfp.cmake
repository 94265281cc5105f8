# Run when the package is installed: -D folder=<the package> -D zfp=<libzfp.so> -D nm=<nm>
# -D patchelf=<patchelf>. Gives the package a libzfp of its own, whose names no other library
# has.
#
# libcfitsio, which ParaView loads, exports stream_open, stream_close, stream_flush and
# stream_size, as does libzfp. The dynamic linker takes the first that a process loaded, for
# libisowave's calls and for libzfp's own. As Debian has no static libzfp, both get new names after
# linking: stream_open becomes isowave_stream_open. So do libzfp's calls to OpenMP, which
# serial_openmp.c answers in place of libgomp.
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
# A libzfp that calls more of OpenMP keeps libgomp.
set(openmp GOMP_parallel omp_get_max_threads omp_get_num_threads omp_get_thread_num)
execute_process(COMMAND ${nm} -D --undefined-only ${zfp}
                OUTPUT_VARIABLE symbols COMMAND_ERROR_IS_FATAL ANY)
string(REGEX MATCHALL "[A-Za-z_0-9]+@+G?OMP_" called "${symbols}")
list(TRANSFORM called REPLACE "@.*" "")
set(unknown ${called})
list(REMOVE_ITEM unknown ${openmp})
set(without_libgomp "")
if(called AND NOT unknown)
  set(without_libgomp --replace-needed libgomp.so.1 libisowave_openmp.so)
  foreach(name IN LISTS called)
    string(APPEND map "${name} isowave_${name}\n")
  endforeach()
endif()
set(map_file ${folder}/zfp_names.txt)
file(WRITE ${map_file} "${map}")

file(COPY_FILE ${zfp} ${folder}/libisowave_zfp.so)
get_filename_component(linked ${zfp} REALPATH)
execute_process(COMMAND ${patchelf} --print-soname ${linked} OUTPUT_VARIABLE soname
                OUTPUT_STRIP_TRAILING_WHITESPACE COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${patchelf} --rename-dynamic-symbols ${map_file}
                        --set-soname libisowave_zfp.so ${without_libgomp} --set-rpath "$ORIGIN"
                        ${folder}/libisowave_zfp.so
                COMMAND_ERROR_IS_FATAL ANY)
execute_process(COMMAND ${patchelf} --rename-dynamic-symbols ${map_file}
                        --replace-needed ${soname} libisowave_zfp.so ${folder}/libisowave.so
                COMMAND_ERROR_IS_FATAL ANY)
file(REMOVE ${map_file})
