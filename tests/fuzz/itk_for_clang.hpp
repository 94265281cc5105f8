#pragma once
// ITK's headers know the compiler they were configured with, GCC, and no other: here clang is taken for GCC while ITK looks.

#pragma push_macro("__clang__")
#pragma push_macro("__GNUC__")
#undef __clang__
#undef __GNUC__
#define __GNUC__ 12
#include <itk_compiler_detection.h>
#pragma pop_macro("__GNUC__")
#pragma pop_macro("__clang__")
