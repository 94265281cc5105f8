#ifdef ISOWAVE_HAS_MPI

#include "tools/isowave/host_words.hpp"

#include <algorithm>
#include <array>
#include <bit>
#include <climits>
#include <cstdlib>

#include "core/base/parallel_for.hpp"

namespace isowave::core::tools {

HostWords::HostWords() {
  int world_rank = 0;
  MPI_Comm_rank(MPI_COMM_WORLD, &world_rank);
  MPI_Comm host = MPI_COMM_NULL;
  MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, world_rank, MPI_INFO_NULL, &host);
  int local_rank = 0;
  MPI_Comm_rank(host, &local_rank);
  const char *most = std::getenv("ISOWAVE_HOST_RANKS");
  const int most_ranks = most != nullptr ? std::max(std::atoi(most), 1) : INT_MAX;
  share(host, local_rank / most_ranks, local_rank);
  if (size_ > 1 && !allocate()) share(host, local_rank, local_rank);
  MPI_Comm_free(&host);
  capacity_ = num_words();
  // Pieces are the same at all hosts.
  MPI_Allreduce(MPI_IN_PLACE, &capacity_, 1, MPI_UINT64_T, MPI_MIN, MPI_COMM_WORLD);
  if (size_ > 1) return;
  alone_.resize(capacity_);
  segments_ = {alone_};
}

void HostWords::reduce(std::size_t begin, std::size_t count, Reduction how, const MakeWords &make,
                       const TakeWords &use) {
  ++number_;
  const Work work{begin, count, how, make};
  if (is_first()) return take(work, use);
  // The words of the reduction before may still be read.
  work.wait([&] { return taken().load(std::memory_order_acquire) == number_ - 1; });
  give(work);
}

/// Gives this process's words, and puts together its share of all but the first's. A task that
/// waits for others waits for tasks of parts before its own, so some process always goes on.
void HostWords::give(const Work &work) {
  const auto others = static_cast<std::size_t>(size_ - 1);
  const std::size_t num_parts = work.num_parts();
  const auto each_part = [&](std::size_t place, const auto &body) {
    for (std::size_t part = place * kTaskParts; part < (place + 1) * kTaskParts; ++part) {
      if (part < num_parts) body(part);
    }
  };
  // A round gives as many places as there are shares; then the place of the round before that is
  // this process's is put together.
  const std::size_t per_round = others * kTaskParts,
                    num_rounds = (num_parts + per_round - 1) / per_round;
  in_order((num_rounds + 1) * (others + 1), [&](std::size_t task) {
    const std::size_t round = task / (others + 1), place = task % (others + 1);
    if (place < others) {
      each_part(round * others + place, [&](std::size_t part) { give_part(work, part); });
    } else if (round > 0 && others > 1) {
      each_part((round - 1) * others + static_cast<std::size_t>(rank_ - 1),
                [&](std::size_t part) { reduce_part(work, part); });
    }
  });
}

void HostWords::give_part(const Work &work, std::size_t part) {
  const std::size_t from = part * kPartWords, size = work.size_of(part);
  std::array<std::uint64_t, kPartWords> buffer;
  const auto words = std::span(buffer).first(size);
  work.make(work.begin + from, words);
  std::uint32_t runs = 0;
  std::uint64_t num_given = 0;
  for (std::size_t run = 0; run * kRunWords < size; ++run) {
    const std::span<std::uint64_t> to = run_of(rank_, part, run, work);
    const auto own = words.subspan(run * kRunWords, to.size());
    if (!may_change(own, work.how)) continue;
    std::ranges::copy(own, to.begin());
    runs |= 1u << run;
    num_given += to.size();
  }
  given_bytes_ += num_given * sizeof(std::uint64_t);
  set_ready(rank_, part, runs);
}

/// Puts a part of all processes but the first together, in this process's words.
void HostWords::reduce_part(const Work &work, std::size_t part) {
  std::uint32_t runs = wait_for_part(work, rank_, part);
  for (int other = 1; other < size_; ++other) {
    if (other == rank_) continue;
    const std::uint32_t given = wait_for_part(work, other, part);
    for (std::uint32_t left = given; left != 0; left &= left - 1) {
      const auto run = static_cast<std::size_t>(std::countr_zero(left));
      const std::span<std::uint64_t> to = run_of(rank_, part, run, work),
                                     from = run_of(other, part, run, work);
      if ((runs >> run & 1u) != 0) {
        reduce_into(to, from, work.how);
      } else {
        std::ranges::copy(from, to.begin());
      }
    }
    runs |= given;
  }
  set_ready(kOthers, part, runs);
}

/// The first process's part in a reduction: its own words and all others' become the outcome, which
/// is used while it is in the processor's cache.
void HostWords::take(const Work &work, const TakeWords &use) {
  const std::size_t num_parts = work.num_parts();
  in_order((num_parts + kTaskParts - 1) / kTaskParts, [&](std::size_t task) {
    const std::size_t end = std::min((task + 1) * kTaskParts, num_parts);
    for (std::size_t part = task * kTaskParts; part < end; ++part) {
      const std::size_t from = part * kPartWords;
      std::array<std::uint64_t, kPartWords> buffer;
      const auto words = std::span(buffer).first(work.size_of(part));
      work.make(work.begin + from, words);
      if (size_ > 1) {
        const int owner = owner_of(part);
        for (std::uint32_t left = wait_for_part(work, size_ == 2 ? owner : kOthers, part);
             left != 0; left &= left - 1) {
          const auto run = static_cast<std::size_t>(std::countr_zero(left));
          const std::span<std::uint64_t> others = run_of(owner, part, run, work);
          reduce_into(words.subspan(run * kRunWords, others.size()), others, work.how);
        }
      }
      use(work.begin + from, words);
    }
  });
  if (size_ > 1) taken().store(number_, std::memory_order_release);
}

/// Calls body(task) for each task, from several threads. Tasks begin in their order.
void HostWords::in_order(std::size_t num_tasks,
                         const std::function<void(std::size_t task)> &body) const {
  // All processes of the host work at the same time.
  const std::uint32_t num_threads =
      std::max(thread_count(0) / static_cast<std::uint32_t>(size_), 1u);
  std::atomic<std::size_t> next = 0;
  parallel_for(num_tasks, num_threads, [&](std::uint64_t, std::uint32_t) { body(next++); });
}

void HostWords::for_parts(
    std::size_t count, const std::function<void(std::size_t from, std::size_t size)> &body) const {
  constexpr std::size_t kTaskWords = kTaskParts * kPartWords;
  in_order((count + kTaskWords - 1) / kTaskWords, [&](std::size_t task) {
    body(task * kTaskWords, std::min(kTaskWords, count - task * kTaskWords));
  });
}

std::span<std::uint64_t> HostWords::run_of(int rank, std::size_t part, std::size_t run,
                                           const Work &work) const {
  const std::size_t from = part * kPartWords + run * kRunWords;
  return segments_[static_cast<std::size_t>(rank)].subspan(from,
                                                           std::min(kRunWords, work.count - from));
}

/// The runs of the part that were written.
std::uint32_t HostWords::wait_for_part(const Work &work, int rank, std::size_t part) const {
  std::uint64_t found = 0;
  work.wait([&] {
    found = state(rank, part).load(std::memory_order_acquire);
    return found >> 32 == number_;
  });
  return static_cast<std::uint32_t>(found);
}

void HostWords::wait_for_all() {
  if (size_ == 1) return;
  MPI_Request request = MPI_REQUEST_NULL;
  std::atomic_thread_fence(std::memory_order_seq_cst);
  MPI_Ibarrier(comm_, &request);
  wait_for({&request, 1});
  std::atomic_thread_fence(std::memory_order_seq_cst);
}

void HostWords::share(MPI_Comm host, int color, int local_rank) {
  if (comm_ != MPI_COMM_NULL) MPI_Comm_free(&comm_);
  MPI_Comm_split(host, color, local_rank, &comm_);
  MPI_Comm_rank(comm_, &rank_);
  MPI_Comm_size(comm_, &size_);
}

/// False, at all processes, if one cannot. MPI's own shared memory leaves them waiting for
/// each other then.
bool HostWords::allocate() {
  std::array<char, 64> name{};  // empty: there is none
  if (is_first()) {
    memory_ = platform::SharedMemory::make(num_bytes());
    if (memory_.data() != nullptr) memory_.name().copy(name.data(), name.size() - 1);
  }
  MPI_Bcast(name.data(), static_cast<int>(name.size()), MPI_CHAR, 0, comm_);
  if (name.front() != '\0' && !is_first())
    memory_ = platform::SharedMemory::open(name.data(), num_bytes());
  int is_there = memory_.data() != nullptr ? 1 : 0;
  MPI_Allreduce(MPI_IN_PLACE, &is_there, 1, MPI_INT, MPI_LAND, comm_);
  if (is_first()) memory_.remove_name();
  if (is_there == 0) return false;
  auto *words = static_cast<std::uint64_t *>(memory_.data());
  for (int rank = 0; rank < size_; ++rank, words += num_words())
    segments_.emplace_back(words, num_words());
  states_ = words;
  return true;
}

}  // namespace isowave::core::tools

#endif
