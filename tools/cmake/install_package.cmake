# What `cmake --install` installs: library, headers and CMake package of isowave::isowave, and the
# program where it is built.
include(CMakePackageConfigHelpers)

set(package_folder ${CMAKE_INSTALL_LIBDIR}/cmake/isowave)
install(TARGETS isowave_library EXPORT isowaveTargets
        ARCHIVE DESTINATION ${CMAKE_INSTALL_LIBDIR}
        LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR} COMPONENT library)
set(left_out "")
if(NOT ISOWAVE_OPENCL)
  set(left_out REGEX "/(bricks|device|extract|isowave|make_renderer|quick_renderer)[.]hpp$" EXCLUDE)
endif()
install(DIRECTORY ${PROJECT_SOURCE_DIR}/core/api/isowave
        DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} COMPONENT library
        FILES_MATCHING PATTERN *.hpp ${left_out})
install(EXPORT isowaveTargets NAMESPACE isowave:: DESTINATION ${package_folder} COMPONENT library)
configure_package_config_file(${CMAKE_CURRENT_LIST_DIR}/isowaveConfig.cmake.in
                              ${PROJECT_BINARY_DIR}/isowaveConfig.cmake
                              INSTALL_DESTINATION ${package_folder})
# Before 1.0, minor versions may break what users wrote.
write_basic_package_version_file(${PROJECT_BINARY_DIR}/isowaveConfigVersion.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/isowaveConfig.cmake
              ${PROJECT_BINARY_DIR}/isowaveConfigVersion.cmake
        DESTINATION ${package_folder} COMPONENT library)
if(ISOWAVE_BUILD_PROGRAM)
  install(TARGETS isowave COMPONENT program)
  # The engine of `isowave export`, if tools/wasm has made it here or in its own folder.
  foreach(wasm ${PROJECT_BINARY_DIR}/wasm ${PROJECT_SOURCE_DIR}/build/wasm)
    install(FILES ${wasm}/install/share/isowave/page.html.gz
            DESTINATION ${CMAKE_INSTALL_DATADIR}/isowave COMPONENT program OPTIONAL)
  endforeach()
endif()
# The program writes its manual page and completion scripts, if it runs where it is built.
if(ISOWAVE_BUILD_PROGRAM AND NOT CMAKE_CROSSCOMPILING)
  set(shell_files ${PROJECT_BINARY_DIR}/isowave.1)
  set(commands COMMAND isowave man > ${PROJECT_BINARY_DIR}/isowave.1)
  foreach(shell bash zsh fish)
    set(file ${PROJECT_BINARY_DIR}/completion.${shell})
    list(APPEND shell_files ${file})
    list(APPEND commands COMMAND isowave completion ${shell} > ${file})
  endforeach()
  add_custom_command(OUTPUT ${shell_files} ${commands} DEPENDS isowave VERBATIM)
  add_custom_target(isowave_shell_files ALL DEPENDS ${shell_files})
  install(FILES ${PROJECT_BINARY_DIR}/isowave.1
          DESTINATION ${CMAKE_INSTALL_MANDIR}/man1 COMPONENT program)
  install(FILES ${PROJECT_BINARY_DIR}/completion.bash RENAME isowave
          DESTINATION ${CMAKE_INSTALL_DATADIR}/bash-completion/completions COMPONENT program)
  install(FILES ${PROJECT_BINARY_DIR}/completion.zsh RENAME _isowave
          DESTINATION ${CMAKE_INSTALL_DATADIR}/zsh/site-functions COMPONENT program)
  install(FILES ${PROJECT_BINARY_DIR}/completion.fish RENAME isowave.fish
          DESTINATION ${CMAKE_INSTALL_DATADIR}/fish/vendor_completions.d COMPONENT program)
endif()
