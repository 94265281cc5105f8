# OpenCL's headers, and a file by which programs link its functions. The system's own loader has the
# functions: OpenCL.dll, which Windows loads when the first one is called, or macOS's framework.
install(DIRECTORY ${HEADERS}/CL DESTINATION include)
file(STRINGS ${HEADERS}/CL/cl.h functions REGEX "^cl[A-Z][A-Za-z]*\\(")
list(TRANSFORM functions REPLACE "\\(.*" "")
if(WIN32)
  list(JOIN functions "\n" lines)
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/OpenCL.def "LIBRARY OpenCL.dll\nEXPORTS\n${lines}\n")
  set(library ${CMAKE_CURRENT_BINARY_DIR}/libOpenCL.a)
  add_custom_command(OUTPUT ${library} DEPENDS OpenCL.def
    COMMAND ${CMAKE_DLLTOOL} --input-def OpenCL.def --output-delaylib ${library} VERBATIM)
  add_custom_target(opencl_library ALL DEPENDS ${library})
  install(FILES ${library} DESTINATION lib)
elseif(APPLE)
  # Where the headers of Apple's framework are.
  install(DIRECTORY ${HEADERS}/CL/ DESTINATION include/OpenCL)
  list(TRANSFORM functions PREPEND "_")
  list(JOIN functions ", " names)
  string(CONCAT text "--- !tapi-tbd\ntbd-version: 4\ntargets: [ arm64-macos ]\n"
    "install-name: '/System/Library/Frameworks/OpenCL.framework/Versions/A/OpenCL'\n"
    "exports:\n  - targets: [ arm64-macos ]\n    symbols: [ ${names} ]\n...\n")
  file(WRITE ${CMAKE_CURRENT_BINARY_DIR}/libOpenCL.tbd "${text}")
  install(FILES ${CMAKE_CURRENT_BINARY_DIR}/libOpenCL.tbd DESTINATION lib)
endif()
