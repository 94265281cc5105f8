#include "core/ocl/buffer_sizes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <iterator>
#include <limits>
#include <stdexcept>

namespace isowave::core::ocl {

std::uint64_t BufferSize::bytes() const {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint64_t>::max();
  if (count > kMost / element_bytes) return kMost;
  return std::max<std::uint64_t>(count * element_bytes, 1);
}

BufferSizes &BufferSizes::add(const BufferSizes &others) {
  sizes_.insert(sizes_.end(), others.begin(), others.end());
  return *this;
}

void BufferSizes::resize(const BufferSizes &others) {
  for (BufferSize &size : sizes_) {
    const auto found = std::ranges::find(others, size.name, &BufferSize::name);
    if (found != others.end()) size.count = found->count;
  }
}

const BufferSize &BufferSizes::operator[](std::string_view name) const {
  const auto found = std::ranges::find(sizes_, name, &BufferSize::name);
  if (found == sizes_.end())
    throw std::invalid_argument(fmt::format("sizes() states no buffer '{}'", name));
  return *found;
}

BufferSizes BufferSizes::named(std::string_view name) const {
  BufferSizes found;
  std::ranges::copy_if(sizes_, std::back_inserter(found.sizes_),
                       [&](const BufferSize &size) { return size.name == name; });
  return found;
}

std::uint64_t BufferSizes::bytes() const {
  std::uint64_t sum = 0;
  for (const BufferSize &size : sizes_) sum += size.bytes();
  return sum;
}

}  // namespace isowave::core::ocl
