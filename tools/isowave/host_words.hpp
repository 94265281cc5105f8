#pragma once
// Words of the processes of one host, in memory that all of them see. So they are reduced without
// messages, by all processes and their threads.
//
// Words go in parts, and parts in runs. A run whose words cannot change the outcome is not written,
// and not read: of the more bricks, the smaller a part of the picture each shows, so the fewer
// words each process gives. Every process but the first has a share of the parts. It puts together
// what all but the first have given of its share, while the next parts are made. The first process
// adds its own words, and takes the outcome.

#include <mpi.h>

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/base/team.hpp"
#include "core/platform/shared_memory.hpp"
#include "tools/isowave/mpi_wait.hpp"

namespace isowave::core::tools {

class HostWords {
 public:
  /// All processes make one. With ISOWAVE_HOST_RANKS=N, no more than N share memory, as if a host
  /// had no more; and each is alone if the host has no shared memory to give.
  HostWords();
  ~HostWords() { MPI_Comm_free(&comm_); }
  HostWords(const HostWords &) = delete;
  HostWords &operator=(const HostWords &) = delete;

  bool is_first() const { return rank_ == 0; }

  /// Words that each process has room for here.
  std::size_t capacity() const { return capacity_; }
  /// Words of the host's first process, for the words of all.
  std::span<std::uint64_t> first() const { return segments_.front(); }
  /// Bytes of words that this process has written for others, so far.
  std::uint64_t given_bytes() const { return given_bytes_; }

  /// Reduces words [begin, begin + count), no more than capacity(). use: takes the outcome, at the
  /// host's first process. The others return when they have done their share.
  void reduce(std::size_t begin, std::size_t count, Reduction how, const MakeWords &make,
              const TakeWords &use);

  /// Calls body(from, size) for parts of [0, count), from several threads.
  void for_parts(std::size_t count,
                 const std::function<void(std::size_t from, std::size_t size)> &body) const;

  void wait_for_all();

 private:
  static constexpr std::size_t kRunWords = 64, kRuns = 32, kPartWords = kRuns * kRunWords;
  /// Parts that a thread takes at a time: waking one for less takes longer than the work.
  static constexpr std::size_t kTaskParts = 2;
  // Containers often have but 64 MiB of shared memory.
  static constexpr std::size_t kHostWords = std::size_t{1} << 22;
  static constexpr std::size_t kMostWords = std::size_t{1} << 20;  ///< of each process
  /// Stands for a rank: all processes but the first, put together.
  static constexpr int kOthers = 0;

  /// A reduction at work.
  struct Work {
    std::size_t begin, count;
    Reduction how;
    const MakeWords &make;
    Wait wait{};

    std::size_t num_parts() const { return (count + kPartWords - 1) / kPartWords; }
    std::size_t size_of(std::size_t part) const {
      return std::min(kPartWords, count - part * kPartWords);
    }
  };

  void give(const Work &work);
  void give_part(const Work &work, std::size_t part);
  void reduce_part(const Work &work, std::size_t part);
  void take(const Work &work, const TakeWords &use);
  void in_order(std::size_t num_tasks, const std::function<void(std::size_t task)> &body) const;

  /// The process that puts together a part of all but the first.
  int owner_of(std::size_t part) const {
    return 1 + static_cast<int>(part / kTaskParts % static_cast<std::size_t>(size_ - 1));
  }
  std::span<std::uint64_t> run_of(int rank, std::size_t part, std::size_t run,
                                  const Work &work) const;

  /// The state of a part: the number of the reduction that its words are of, above a bit for each
  /// run that was written.
  std::atomic_ref<std::uint64_t> state(int rank, std::size_t part) const {
    return std::atomic_ref(states_[static_cast<std::size_t>(rank) * num_parts() + part]);
  }
  void set_ready(int rank, std::size_t part, std::uint32_t runs) const {
    state(rank, part).store(std::uint64_t{number_} << 32 | runs, std::memory_order_release);
  }
  std::uint32_t wait_for_part(const Work &work, int rank, std::size_t part) const;
  /// The last reduction of which the first process has taken everything.
  std::atomic_ref<std::uint64_t> taken() const {
    return std::atomic_ref(states_[static_cast<std::size_t>(size_) * num_parts()]);
  }

  void share(MPI_Comm host, int color, int local_rank);
  bool allocate();
  std::size_t num_words() const {
    return std::min(kHostWords / static_cast<std::size_t>(size_), kMostWords);
  }
  std::size_t num_parts() const { return (num_words() + kPartWords - 1) / kPartWords; }
  std::size_t num_bytes() const {
    return sizeof(std::uint64_t) *
           (static_cast<std::size_t>(size_) * (num_words() + num_parts()) + 1);
  }

  MPI_Comm comm_ = MPI_COMM_NULL;
  platform::SharedMemory memory_;
  int rank_ = 0, size_ = 1;
  std::uint64_t capacity_ = 0;
  std::vector<std::span<std::uint64_t>> segments_;  ///< by rank
  std::uint64_t *states_ = nullptr;                 ///< by rank and part, then taken()
  std::uint32_t number_ = 0;                        ///< of the reduction at work
  std::atomic<std::uint64_t> given_bytes_ = 0;
  std::vector<std::uint64_t> alone_;  ///< of a process that shares with none
};

}  // namespace isowave::core::tools
