# OpenCL's headers, and a file by which programs link its functions. The system's own loader has the
# functions: OpenCL.dll, which Windows loads when the first one is called.
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
endif()
