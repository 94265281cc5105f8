// Kernel files and their headers, joined into one text.

#include "core/ocl/kernel_sources.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>

namespace isowave::core {
namespace {

using ocl::KernelFile;

TEST(KernelSources, AHeaderIsThereOnceWhereItIsFirstIncluded) {
  const KernelFile files[] = {
      {"a.cl", "first\n#include \"portable/b.h\"\n#include \"c.h\"\nlast\n"},
      {"c.h", "at the top\n"},
      {"portable/b.h", "#include \"c.h\"\n#include <system>\nb"},
      {"portable/c.h", "beside b\n"},
  };
  EXPECT_EQ(ocl::join_kernel_file(files, 0),
            "#line 1 \"a.cl\"\nfirst\n"
            "#line 1 \"portable/b.h\"\n"
            "#line 1 \"portable/c.h\"\nbeside b\n\n"
            "#line 2 \"portable/b.h\"\n#include <system>\nb\n"
            "#line 3 \"a.cl\"\n"
            "#line 1 \"c.h\"\nat the top\n\n"
            "#line 4 \"a.cl\"\nlast\n\n");
}

TEST(KernelSources, HeadersMayIncludeEachOther) {
  const KernelFile files[] = {{"a.h", "#include \"b.h\"\na\n"}, {"b.h", "#include \"a.h\"\nb\n"}};
  EXPECT_EQ(ocl::join_kernel_file(files, 0),
            "#line 1 \"a.h\"\n#line 1 \"b.h\"\n#line 2 \"b.h\"\nb\n\n#line 2 \"a.h\"\na\n\n");
}

TEST(KernelSources, WhatIsMissingIsNamed) {
  const KernelFile files[] = {{"a.cl", "#include \"b.h\"\n"}};
  EXPECT_THROW(ocl::join_kernel_file(files, 0), std::invalid_argument);
  EXPECT_THROW(ocl::kernel_text("no_such_stem"), std::invalid_argument);
}

TEST(KernelSources, EveryKernelHasItsHeaders) {
  std::size_t num_kernels = 0;
  for (const KernelFile &file : ocl::kernel_files()) {
    if (!file.name.ends_with(".cl")) continue;
    ++num_kernels;
    const std::string_view stem = file.name.substr(file.name.find_last_of('/') + 1);
    const std::string text = ocl::kernel_text(stem.substr(0, stem.size() - 3));
    EXPECT_TRUE(text.starts_with("#line 1 \"" + std::string(file.name) + "\"\n"));
    EXPECT_THAT(text, testing::Not(testing::HasSubstr("#include \"")));
    EXPECT_THAT(text, testing::HasSubstr("#line 1 \"portable/shared_types.h\"\n"));
  }
  EXPECT_GT(num_kernels, 15u);
}

}  // namespace
}  // namespace isowave::core
