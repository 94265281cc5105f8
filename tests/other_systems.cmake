# Libraries without OpenCL and for other systems, and what is made of them. tests/CMakeLists.txt
# includes this file.

add_test(NAME host_only CONFIGURATIONS Long
         COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/host_only_test.sh
                 ${PROJECT_SOURCE_DIR} $<TARGET_FILE:isowave>)
set_tests_properties(host_only PROPERTIES ENVIRONMENT ISOWAVE_DEVICE=cpu TIMEOUT 900 COST 100)
foreach(system aarch64 windows macos)
  add_test(NAME cross_${system} CONFIGURATIONS Long
           COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/cross_test.sh
                   ${system} ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR} $<TARGET_FILE:isowave>)
  set_tests_properties(cross_${system} PROPERTIES TIMEOUT 5400 COST 2000 SKIP_RETURN_CODE 77)
endforeach()
add_test(NAME cross_wheel CONFIGURATIONS Long
         COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/cross_wheel_test.sh
                 ${PROJECT_SOURCE_DIR} $<TARGET_FILE:isowave>)
set_tests_properties(cross_wheel PROPERTIES TIMEOUT 3600 COST 1000 SKIP_RETURN_CODE 77)
# They build in one folder.
set_tests_properties(cross_aarch64 cross_wheel PROPERTIES RESOURCE_LOCK aarch64)
add_test(NAME wasm
         COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/wasm_test.sh
                 ${PROJECT_SOURCE_DIR} ${PROJECT_BINARY_DIR}/wasm $<TARGET_FILE:isowave>)
set_tests_properties(wasm PROPERTIES ENVIRONMENT ISOWAVE_DEVICE=cpu TIMEOUT 1500 COST 1900
                     FIXTURES_SETUP page_engine)
add_test(NAME site
         COMMAND ${CMAKE_CURRENT_SOURCE_DIR}/site_test.sh
                 ${PROJECT_SOURCE_DIR} $<TARGET_FILE:isowave>)
set_tests_properties(site PROPERTIES TIMEOUT 600 COST 30 FIXTURES_REQUIRED page_engine)
