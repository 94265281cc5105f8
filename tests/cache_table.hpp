#pragma once
// The block cache's table (kernels_cl/portable/block_table.h), as the host reads it.

#include <gtest/gtest.h>

#include <algorithm>
#include <set>
#include <span>
#include <vector>

#include "kernels_cl/portable/block_table.h"

namespace isowave::core::test {

/// [blocks] slot of each block, ISO_BLOCK_ABSENT if it is not cached.
inline std::vector<uint> slots_by_block(const FrameParams &frame, std::span<const uint> table) {
  std::vector<uint> slots;
  for (uint z = 0; z < frame.grid.blocks_z; ++z) {
    for (uint y = 0; y < frame.grid.blocks_y; ++y) {
      for (uint x = 0; x < frame.grid.blocks_x; ++x)
        slots.push_back(cached_slot(&frame, table.data(), x, y, z));
    }
  }
  return slots;
}

/// A group of blocks has a page of its own if one of them is cached, and the page counts those.
/// Other pages are empty, and free.
inline void expect_pages_of_cached_blocks(const FrameParams &frame, std::span<const uint> table) {
  const uint num_slots = frame.schedule.cache_slots, none = empty_page(num_slots);
  const auto cached_in = [&](uint page) {
    return std::ranges::count_if(table.subspan(std::size_t{8} * page, 8),
                                 [](uint slot) { return slot != ISO_BLOCK_ABSENT; });
  };
  std::set<uint> pages;
  for (uint z = 0; z < frame.grid.blocks_z; z += 2) {
    for (uint y = 0; y < frame.grid.blocks_y; y += 2) {
      for (uint x = 0; x < frame.grid.blocks_x; x += 2) {
        const uint page = table[directory_word(&frame, x, y, z)];
        ASSERT_LE(page, none);
        if (page == none) continue;
        ASSERT_TRUE(pages.insert(page).second) << "page " << page << " is of two groups";
        ASSERT_GT(cached_in(page), 0) << "of page " << page;
      }
    }
  }
  for (uint page = 0; page < num_slots; ++page) {
    ASSERT_EQ(table[page_count_at(num_slots, page)], cached_in(page)) << "of page " << page;
    ASSERT_TRUE(pages.contains(page) || cached_in(page) == 0) << "lost page " << page;
  }
  ASSERT_EQ(cached_in(none), 0);
}

}  // namespace isowave::core::test
