#pragma once
// Threads that stand for the processes of a team: what they say to each other, by rank.

#include <algorithm>
#include <barrier>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/team.hpp"

namespace isowave::core::test {

/// All threads make the same calls in the same order.
class ThreadMeeting {
 public:
  explicit ThreadMeeting(std::uint32_t size) : texts_(size), words_(size), barrier_(size) {}

  std::uint32_t size() const { return static_cast<std::uint32_t>(texts_.size()); }

  std::vector<std::string> all_gather(std::uint32_t rank, const std::string &text) {
    texts_[rank] = text;
    barrier_.arrive_and_wait();
    std::vector<std::string> texts = texts_;
    barrier_.arrive_and_wait();
    return texts;
  }

  /// Makes one word of all threads' at each place. Rank 0 has them then, or all.
  void reduce(std::uint32_t rank, std::span<std::uint64_t> words, Reduction how, bool for_all) {
    words_[rank] = words;
    barrier_.arrive_and_wait();
    std::vector<std::uint64_t> result(words.begin(), words.end());
    for (const std::span<std::uint64_t> others : words_) reduce_into(result, others, how);
    barrier_.arrive_and_wait();
    if (rank == 0 || for_all) std::ranges::copy(result, words.begin());
  }

 private:
  std::vector<std::string> texts_;
  std::vector<std::span<std::uint64_t>> words_;
  std::barrier<> barrier_;
};

}  // namespace isowave::core::test
