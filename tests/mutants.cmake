# Planted bugs. A mutant is the scalar twin built from a copy of the portable headers with one line
# changed; its test succeeds when the stability suite or the watertight test notices. A device
# mutant is the program of the watertight test of devices with a changed copy of all kernels; its
# test succeeds when each pipeline that has the bug leaks. A predicate mutant compares the walk's
# float filter, changed, with two-float arithmetic. A change that no longer applies stops the
# configuring.

add_library(mutant_main OBJECT mutant_main.cpp)
target_link_libraries(mutant_main PRIVATE isowave_reference)
# -w: what a bug leaves unused is no matter.
target_compile_options(mutant_main PRIVATE -w $<$<CONFIG:Release>:-O1>)
target_precompile_headers(mutant_main PRIVATE
  <CL/opencl.hpp> <algorithm> <fmt/format.h> <glm/glm.hpp> <thread> <vector>)

# copy_with_bug(<name> <pattern> <file> <line as it stands> <line with the bug>): files of
# kernels_cl into mutants/<name>/kernels_cl.
function(copy_with_bug name pattern file from to)
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/mutants/${name}/kernels_cl)
  file(COPY ${PROJECT_SOURCE_DIR}/kernels_cl/ DESTINATION ${folder} FILES_MATCHING REGEX ${pattern})
  file(READ ${PROJECT_SOURCE_DIR}/kernels_cl/${file} text)
  string(FIND "${text}" "${from}" place)
  if(place EQUAL -1)
    message(FATAL_ERROR "mutant ${name}: ${file} no longer has the line\n${from}")
  endif()
  string(REPLACE "${from}" "${to}" text "${text}")
  file(CONFIGURE OUTPUT ${folder}/${file} CONTENT "${text}" @ONLY)
  file(GLOB_RECURSE originals
       ${PROJECT_SOURCE_DIR}/kernels_cl/*.h ${PROJECT_SOURCE_DIR}/kernels_cl/*.cl)
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${originals})
endfunction()

# add_mutant(<name> <header of portable/> <line as it stands> <line with the bug>)
function(add_mutant name header from to)
  copy_with_bug(${name} "\\.h$" portable/${header} "${from}" "${to}")
  add_executable(mutant_${name}
    $<TARGET_OBJECTS:mutant_main> ${PROJECT_SOURCE_DIR}/reference/scalar_renderer.cpp)
  target_include_directories(mutant_${name} BEFORE PRIVATE
    ${CMAKE_CURRENT_BINARY_DIR}/mutants/${name})
  target_link_libraries(mutant_${name} PRIVATE isowave_reference)
  target_compile_options(mutant_${name} PRIVATE $<TARGET_PROPERTY:mutant_main,COMPILE_OPTIONS>)
  target_precompile_headers(mutant_${name} REUSE_FROM mutant_main)
  # Or clang-tidy would check scalar_renderer.cpp once more for each.
  set_target_properties(mutant_${name} PROPERTIES EXPORT_COMPILE_COMMANDS OFF)
  add_test(NAME mutant.${name} COMMAND mutant_${name})
endfunction()

add_mutant(none_at_all cubic.h "/// cubic.h" "/// cubic.h")  # what the others start from must pass
set_tests_properties(mutant.none_at_all PROPERTIES WILL_FAIL TRUE)

# Traversal.
add_mutant(other_plane_moves grid_dda.h "if (exit.axis == 0) {" "if (exit.axis != 1) {")
add_mutant(missing_carry two_float.h
  "return a.hi < b.hi || (a.hi == b.hi && a.lo < b.lo);" "return a.hi < b.hi;")
add_mutant(float_plane_t grid_dda.h
  "fma(s, a.inv_d.hi, -h) + fma(s, a.inv_d.lo, e * a.inv_d.hi);" "0.0f;")
add_mutant(float_position grid_dda.h "const float x = r + (re + (pe + se));" "const float x = r;")
add_mutant(domain_end grid_dda.h
  "return whole_plane(a, plane > last_plane ? last_plane : plane);"
  "return whole_plane(a, plane);")

# Intersection.
add_mutant(open_interval solve_bernstein.h
  "in0 = c.b0 >= 0.0f, in1 = c.b1 >= 0.0f, in2 = c.b2 >= 0.0f, in3 = c.b3 >= 0.0f;"
  "in0 = c.b0 > 0.0f, in1 = c.b1 > 0.0f, in2 = c.b2 > 0.0f, in3 = c.b3 > 0.0f;")
add_mutant(open_end solve_bernstein.h "in3 = c.b3 >= 0.0f;" "in3 = c.b3 > 0.0f;")
add_mutant(one_crossing_only solve_bernstein.h
  "if (in0 == in1 && in0 == in2 && in0 == in3) return 0;" "if (in0 == in3) return 0;")
add_mutant(second_extremum solve_bernstein.h
  "at.second = s_a < s_b ? s_b : s_a;" "at.second = -1.0f;")
add_mutant(lost_extrema solve_bernstein.h
  "if (at.discriminant > 0.0f)" "if (at.discriminant > 0.05f)")
add_mutant(unbracketed_newton solve_bernstein.h
  "if (!(next > lo && next < hi))" "if (next != next)")
add_mutant(stops_early solve_bernstein.h
  "#define ISO_ROOT_STEP 0x1p-23f" "#define ISO_ROOT_STEP 0x1p-4f")
add_mutant(last_corner cell_intersect.h "(w[7] >= 0.0f) != in;" "0;")
add_mutant(entry_for_exit cell_intersect.h
  "c.b2 = (lerp(a.z, bb0, bb1)" "c.b2 = (lerp(b.z, bb0, bb1)")

# The float filter. Its own program, since a wrong order of two moments that are almost one moves
# no hit that the suites could see. By hand, with more rays: predicate_fuzz 10000000.
add_executable(predicate_fuzz predicate_fuzz_main.cpp)
target_link_libraries(predicate_fuzz PRIVATE isowave_flags)
target_compile_options(predicate_fuzz PRIVATE $<$<CONFIG:Release>:-O1>)
add_test(NAME predicate_fuzz COMMAND predicate_fuzz 300000)
add_test(NAME predicate_fuzz_long CONFIGURATIONS Long COMMAND predicate_fuzz 10000000)
set_tests_properties(predicate_fuzz_long PROPERTIES TIMEOUT 3600)

# add_predicate_mutant(<name> <line of grid_dda.h as it stands> <line with the bug>)
function(add_predicate_mutant name from to)
  set(mutant predicate_${name})
  copy_with_bug(${mutant} "\\.h$" portable/grid_dda.h "${from}" "${to}")
  add_executable(mutant_${mutant} predicate_fuzz_main.cpp)
  target_include_directories(mutant_${mutant} BEFORE PRIVATE
    ${CMAKE_CURRENT_BINARY_DIR}/mutants/${mutant})
  target_link_libraries(mutant_${mutant} PRIVATE isowave_flags)
  target_compile_options(mutant_${mutant} PRIVATE -w $<$<CONFIG:Release>:-O1>)
  set_target_properties(mutant_${mutant} PROPERTIES EXPORT_COMPILE_COMMANDS OFF)
  add_test(NAME mutant.${mutant} COMMAND mutant_${mutant})
  set_tests_properties(mutant.${mutant} PROPERTIES WILL_FAIL TRUE)
endfunction()
add_predicate_mutant(narrow_doubt "ISO_FLOAT_DOUBT 0x1p-20f" "ISO_FLOAT_DOUBT 0x1p-23f")
add_predicate_mutant(sign_of_doubt "ISO_FLOAT_DOUBT * fabs(later)" "ISO_FLOAT_DOUBT * later")
add_predicate_mutant(forgotten_axis
  "second = not_z < not_xy ? not_z : not_xy;" "second = not_z;")
add_predicate_mutant(sure_position
  "const float error = 0x1p-22f * (fabs(p) + fabs(a.o));"
  "const float error = 0x1p-25f * (fabs(p) + fabs(a.o));")

# What only devices have: each line is for the watertight test of devices.
add_library(device_mutant_main OBJECT device_mutant_main.cpp)
target_link_libraries(device_mutant_main PRIVATE isowave_reference)

# add_device_mutant(<name> <pipelines that leak> <file> <line as it stands> <line with the bug>
# [CONFIGURATIONS Long]). Each compiles all kernels of its pipelines.
function(add_device_mutant name pipelines file from to)
  set(mutant device_${name})
  set(folder ${CMAKE_CURRENT_BINARY_DIR}/mutants/${mutant})
  copy_with_bug(${mutant} "\\.(h|cl)$" ${file} "${from}" "${to}")
  file(GLOB_RECURSE files ${folder}/kernels_cl/*.cl ${folder}/kernels_cl/*.h)
  add_custom_command(
    OUTPUT ${folder}/kernels.cpp
    COMMAND ${CMAKE_COMMAND} -D "output=${folder}/kernels.cpp" -D "folder=${folder}/kernels_cl"
            -D "files=${files}" -P ${embed_kernels_script}
    DEPENDS ${files} ${embed_kernels_script} ${kernel_signatures} VERBATIM)
  # The linker takes these kernels, and not those of isowave_kernels behind them.
  add_executable(mutant_${mutant} $<TARGET_OBJECTS:device_mutant_main> ${folder}/kernels.cpp)
  target_link_libraries(mutant_${mutant} PRIVATE isowave_reference)
  set_target_properties(mutant_${mutant} PROPERTIES EXPORT_COMPILE_COMMANDS OFF)
  add_test(NAME mutant.${mutant} COMMAND mutant_${mutant} ${pipelines} ${ARGN})
  set_tests_properties(mutant.${mutant} PROPERTIES ENVIRONMENT ISOWAVE_DEVICE=cpu TIMEOUT 300)
endfunction()

add_device_mutant(none_at_all "rays;packets;blocks" macrocells.cl
  "/// macrocells.cl" "/// macrocells.cl")
set_tests_properties(mutant.device_none_at_all PROPERTIES WILL_FAIL TRUE)
add_device_mutant(own_voxels_only "rays;packets;blocks" macrocells.cl
  "    range = join(range, (corner & 4 ?"
  "    if (corner == 0) range = join(range, (corner & 4 ?" CONFIGURATIONS Long)
add_device_mutant(half_of_macrocells "rays;blocks" device/block_walk.h
  "(bit < 32 ? low >> bit : high >> (bit - 32)) & 1u" "(bit < 32 ? low >> bit : 0u) & 1u")
add_device_mutant(lost_results blocks device/closest_pair.h "atomic_min(" "atomic_max("
  CONFIGURATIONS Long)
add_device_mutant(half_of_blocks packets portable/packet_regions.h
  "pick(level->place < 32, level->low, level->high)"
  "pick(level->place < 32, level->low, ints(0))")
add_device_mutant(one_crossing_of_packets packets portable/packet_walk.h
  "lanes & ((in0 ^ in1) | (in0 ^ in2) | (in0 ^ in3))" "lanes & (in0 ^ in3)" CONFIGURATIONS Long)
add_device_mutant(narrow_way packets portable/packet_walk.h
  "pick(a->up, to, place[axis]) & 3" "place[axis] & 3" CONFIGURATIONS Long)
