#include "tools/isowave/compile_report.hpp"

#include <fmt/format.h>

#include <cstdio>
#include <utility>

#include "core/platform/streams.hpp"

namespace isowave::core::tools {

namespace {

/// Shorter compilations are not worth looking through the driver's folder: no user notices them.
constexpr double kWorthSayingMs = 250;

}  // namespace

CompileReport::CompileReport(ocl::Device &device) : device_(device), cache_(device.info()) {
  if (!platform::errors_go_to_terminal()) return;
  device_.on_new_kernel([this](std::string_view kernel) {
    fmt::print(stderr, "\r\x1b[Kcompiling kernels for {}: {}, {}", device_.info().name,
               ++num_kernels_, kernel);
    std::fflush(stderr);
  });
}

CompileReport::~CompileReport() {
  device_.on_new_kernel({});
  if (num_kernels_ != 0) std::fputs("\r\x1b[K", stderr);  // after an error
}

void CompileReport::finish() {
  if (std::exchange(num_kernels_, 0) != 0) fmt::print(stderr, "\r\x1b[K");
  const double ms = device_.compile_ms() - std::exchange(reported_ms_, device_.compile_ms());
  if (ms < kWorthSayingMs) return;
  if (!cache_.folder()) {
    fmt::print("compiling kernels for {}: {:.1f} s\n", device_.info().name, ms / 1000);
  } else if (cache_.has_new_kernels()) {
    fmt::print(
        "compiling kernels for {}: {:.1f} s; its driver keeps them for the next time in {}\n",
        device_.info().name, ms / 1000, cache_.folder()->string());
  }
  cache_ = ocl::KernelCache(device_.info());
}

}  // namespace isowave::core::tools
