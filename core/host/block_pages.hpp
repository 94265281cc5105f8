#pragma once
// Large arrays with items of blocks. Only parts are ever written to, page by page. Places in an
// array have 64 bits, even if addresses have 32.

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <type_traits>
#include <vector>

#include "core/base/reserved_memory.hpp"
#include "core/platform/memory.hpp"
#include "kernels_cl/portable/shared_types.h"

namespace isowave::core {

/// Items of a page if the system has no pages: the voxels of four blocks, or numbers of sixteen.
template <class T>
constexpr std::size_t kPageItems = sizeof(T) == sizeof(float) ? 256 : 16;

/// An array one page behind the other, or by a table of pages.
template <class T, bool kHasPages = platform::kHasPages>
struct BlockItems {
  T *items;
  T &operator[](std::uint64_t i) const { return items[i]; }
};
template <class T>
struct BlockItems<T, false> {
  T *const *pages;
  T &operator[](std::uint64_t i) const {
    return pages[static_cast<std::size_t>(i / kPageItems<T>)]
                [static_cast<std::size_t>(i % kPageItems<T>)];
  }
};

/// Pages of a system that has none. Pages that were not taken share one, of zeros.
template <class T>
class PageTable {
 public:
  explicit PageTable(std::uint64_t num_items)
      : pages_((num_items + kPageItems<T> - 1) / kPageItems<T>, zeros()) {}

  BlockItems<T, false> items() const { return {pages_.data()}; }
  void take(std::size_t page) {
    if (num_free_ == 0) {
      slabs_.push_back(std::make_unique<T[]>(kSlabPages * kPageItems<T>));
      num_free_ = kSlabPages;
    }
    pages_[page] = slabs_.back().get() + kPageItems<T> * --num_free_;
  }
  void release() {
    std::ranges::fill(pages_, zeros());
    slabs_.clear();
    num_free_ = 0;
  }

 private:
  static constexpr std::size_t kSlabPages = 64;
  static T *zeros() {
    static std::array<T, kPageItems<T>> page{};
    return page.data();
  }

  std::vector<T *> pages_;
  std::vector<std::unique_ptr<T[]>> slabs_{};
  std::size_t num_free_ = 0;  ///< pages of the last slab
};

/// Pages of the system.
template <class T>
class SystemPages {
 public:
  explicit SystemPages(std::uint64_t num_items) : memory_(num_items * sizeof(T)) {}

  BlockItems<T, true> items() const { return {static_cast<T *>(memory_.data())}; }
  void take(std::size_t) {}
  void release() { memory_.release(); }

 private:
  ReservedMemory memory_;
};

/// An array of zeros. Before a part is written to, its page must be taken.
template <class T, bool kHasPages = platform::kHasPages>
class BlockPages {
 public:
  explicit BlockPages(std::uint64_t num_items) : pages_(num_items), taken_(num_pages(num_items)) {}

  static std::uint64_t page_bytes() {
    return kHasPages ? platform::page_bytes() : kPageItems<T> * sizeof(T);
  }
  /// Memory of such an array if no page is taken.
  static std::uint64_t table_bytes(std::uint64_t num_items) {
    return num_pages(num_items) * (kHasPages ? 1 : 1 + sizeof(T *));
  }

  BlockItems<T, kHasPages> items() const { return pages_.items(); }
  bool is_taken(std::uint64_t item) const {
    return taken_[page_of(item)].load(std::memory_order_relaxed) != 0;
  }
  /// Takes the page of an item. Returns whether nothing else has.
  bool take(std::uint64_t item) {
    const std::size_t page = page_of(item);
    if (taken_[page].exchange(1, std::memory_order_relaxed) != 0) return false;
    pages_.take(page);
    return true;
  }
  /// Gives all pages back; what was written is zeros again. Returns how many there were.
  std::uint64_t release() {
    const auto num_taken = std::ranges::count_if(
        taken_, [](const std::atomic<uchar> &taken) { return taken.load() != 0; });
    pages_.release();
    for (std::atomic<uchar> &taken : taken_) taken.store(0, std::memory_order_relaxed);
    return static_cast<std::uint64_t>(num_taken);
  }

 private:
  static std::uint64_t num_pages(std::uint64_t num_items) {
    return (num_items * sizeof(T) + page_bytes() - 1) / page_bytes();
  }
  static std::size_t page_of(std::uint64_t item) {
    return static_cast<std::size_t>(item * sizeof(T) / page_bytes());
  }

  std::conditional_t<kHasPages, SystemPages<T>, PageTable<T>> pages_;
  std::vector<std::atomic<uchar>> taken_;  ///< [page]
};

}  // namespace isowave::core
