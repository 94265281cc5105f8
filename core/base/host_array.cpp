#include "core/base/host_array.hpp"

#include <algorithm>
#include <atomic>
#include <new>

namespace isowave::core {

namespace {

constexpr std::size_t kPage = 4096;

/// Memory that begins with a page, which devices need to copy into it directly.
std::shared_ptr<std::byte> make_memory(std::size_t bytes) {
  constexpr std::align_val_t kAligned{kPage};
  return {static_cast<std::byte *>(::operator new(bytes, kAligned)),
          [](std::byte *memory) { ::operator delete(memory, kAligned); }};
}

}  // namespace

std::shared_ptr<std::byte> HostMemory::take(std::size_t bytes) {
  bytes = (std::max<std::size_t>(bytes, 1) + kPage - 1) / kPage * kPage;
  const auto is_free = [](const Piece &piece) { return piece.memory.use_count() == 1; };
  const auto fitting = std::ranges::find_if(pieces_, [&](const Piece &piece) {
    return is_free(piece) && piece.bytes >= bytes && piece.bytes / 2 <= bytes;
  });
  if (fitting != pieces_.end()) {
    std::atomic_thread_fence(std::memory_order_acquire);  // the last array's reads are over
    return fitting->memory;
  }
  if (pieces_.size() == kMostPieces) {
    const auto unused = std::ranges::find_if(pieces_, is_free);
    const auto leaving = unused == pieces_.end() ? pieces_.begin() : unused;
    leaving->pinned.reset();
    pieces_.erase(leaving);
  }
  Piece piece{make_memory(bytes), bytes, {}};
  if (pin_) piece.pinned = pin_({piece.memory.get(), bytes});
  return pieces_.emplace_back(std::move(piece)).memory;
}

}  // namespace isowave::core
