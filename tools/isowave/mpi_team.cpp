#include "tools/isowave/mpi_team.hpp"

#ifdef ISOWAVE_HAS_MPI

#include <mpi.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <climits>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <thread>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/platform/shared_memory.hpp"
#include "core/platform/signals.hpp"
#include "core/platform/streams.hpp"
#include "core/zfp/zfp_trailer.hpp"
#include "tools/isowave/mpi_file.hpp"

namespace isowave::core::tools {

namespace {

/// Waits as fast as a processor can at first, then with naps: others may draw on that processor.
class Wait {
 public:
  template <class IsDone>
  void operator()(const IsDone &is_done) const {
    constexpr std::chrono::milliseconds kFast{1};
    constexpr std::chrono::microseconds kNap{50};
    while (!is_done()) {
      if (std::chrono::steady_clock::now() - begin_ > kFast) std::this_thread::sleep_for(kNap);
    }
  }

 private:
  std::chrono::steady_clock::time_point begin_ = std::chrono::steady_clock::now();
};

void wait_for(std::span<MPI_Request> requests) {
  Wait()([&] {
    int done = 0;
    MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
    return done != 0;
  });
}

template <class Byte, class Use>
void for_pieces(std::span<Byte> bytes, const Use &use) {
  for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), kMostMpiBytes)))
    use(bytes.first(std::min(bytes.size(), kMostMpiBytes)));
}

/// Words of the processes of one host, in memory that all of them see. So they are reduced without
/// a copy, by all processes and their threads.
class HostWords {
 public:
  /// All processes make one. With ISOWAVE_HOST_RANKS=N, no more than N share memory, as if a host
  /// had no more; and each is alone if the host has no shared memory to give.
  HostWords() {
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
  ~HostWords() { MPI_Comm_free(&comm_); }
  HostWords(const HostWords &) = delete;
  HostWords &operator=(const HostWords &) = delete;

  bool is_first() const { return rank_ == 0; }

  /// Words that each process has room for here.
  std::size_t capacity() const { return capacity_; }
  /// Words of the host's first process, for the words of all.
  std::span<std::uint64_t> first() const { return segments_.front(); }

  /// Reduces words [begin, begin + count), no more than capacity(), part by part: what one process
  /// has made of a part is taken on while it makes the next. use: takes the outcome, at the host's
  /// first process.
  void reduce(std::size_t begin, std::size_t count, Reduction how, const MakeWords &make,
              const TakeWords &use) {
    ++number_;
    const Wait wait;
    if (!is_first()) {
      const std::span<std::uint64_t> own = segments_[static_cast<std::size_t>(rank_)];
      for_parts(0, count, [&](std::size_t from, std::size_t size) {
        make(begin + from, own.subspan(from, size));
        set_ready(rank_, from);
      });
      if (size_ > 2) reduce_others(count, how, wait);
    } else {
      // While words are in the processor's cache.
      for_parts(0, count, [&](std::size_t from, std::size_t size) {
        std::array<std::uint64_t, kPartWords> buffer;
        const auto words = std::span(buffer).first(size);
        make(begin + from, words);
        if (size_ > 1) {
          wait([&] { return is_ready(size_ == 2 ? 1 : kOthers, from); });
          reduce_into(words, segments_[1].subspan(from, size), how);
        }
        use(begin + from, words);
      });
    }
    wait_for_all();
  }

  /// Calls body(from, size) for parts of [begin, end), from several threads. begin: of a part.
  template <class Body>
  void for_parts(std::size_t begin, std::size_t end, const Body &body) const {
    // A thread takes several: waking one for less takes longer than the work.
    constexpr std::size_t kParts = 2, kThreadWords = kParts * kPartWords;
    // All processes of the host work at the same time.
    const std::uint32_t num_threads =
        std::max(thread_count(0) / static_cast<std::uint32_t>(size_), 1u);
    parallel_for((end - begin + kThreadWords - 1) / kThreadWords, num_threads,
                 [&](std::uint64_t i, std::uint32_t) {
                   const std::size_t first = begin + i * kThreadWords;
                   const std::size_t last = std::min(first + kThreadWords, end);
                   for (std::size_t from = first; from < last; from += kPartWords)
                     body(from, std::min(kPartWords, last - from));
                 });
  }

  void wait_for_all() {
    if (size_ == 1) return;
    MPI_Request request = MPI_REQUEST_NULL;
    std::atomic_thread_fence(std::memory_order_seq_cst);
    MPI_Ibarrier(comm_, &request);
    wait_for({&request, 1});
    std::atomic_thread_fence(std::memory_order_seq_cst);
  }

 private:
  static constexpr std::size_t kPartWords = std::size_t{1} << 11;
  // Containers often have but 64 MiB of shared memory.
  static constexpr std::size_t kHostWords = std::size_t{1} << 22;
  static constexpr std::size_t kMostWords = std::size_t{1} << 20;  ///< of each process
  /// Stands for a rank: all processes but the first, put together.
  static constexpr int kOthers = 0;

  /// Called by all processes but the first: each reduces its share of the parts into the second's.
  void reduce_others(std::size_t count, Reduction how, const Wait &wait) {
    const std::size_t num_parts = (count + kPartWords - 1) / kPartWords;
    const auto share = [&](int number) {
      const auto parts =
          num_parts * static_cast<std::size_t>(number) / static_cast<std::size_t>(size_ - 1);
      return std::min(parts * kPartWords, count);
    };
    for_parts(share(rank_ - 1), share(rank_), [&](std::size_t from, std::size_t size) {
      for (int other = 1; other < size_; ++other) {
        wait([&] { return is_ready(other, from); });
        if (other == 1) continue;
        reduce_into(segments_[1].subspan(from, size),
                    segments_[static_cast<std::size_t>(other)].subspan(from, size), how);
      }
      set_ready(kOthers, from);
    });
  }

  /// Number of the part that the words of a process, or of kOthers, have from `from` on.
  std::atomic_ref<std::uint32_t> part_number(int rank, std::size_t from) const {
    return std::atomic_ref(
        part_numbers_[static_cast<std::size_t>(rank) * num_parts() + from / kPartWords]);
  }
  void set_ready(int rank, std::size_t from) const {
    part_number(rank, from).store(number_, std::memory_order_release);
  }
  bool is_ready(int rank, std::size_t from) const {
    return part_number(rank, from).load(std::memory_order_acquire) == number_;
  }

  void share(MPI_Comm host, int color, int local_rank) {
    if (comm_ != MPI_COMM_NULL) MPI_Comm_free(&comm_);
    MPI_Comm_split(host, color, local_rank, &comm_);
    MPI_Comm_rank(comm_, &rank_);
    MPI_Comm_size(comm_, &size_);
  }

  std::size_t num_words() const {
    return std::min(kHostWords / static_cast<std::size_t>(size_), kMostWords);
  }
  std::size_t num_parts() const { return (num_words() + kPartWords - 1) / kPartWords; }
  std::size_t num_bytes() const {
    return static_cast<std::size_t>(size_) *
           (num_words() * sizeof(std::uint64_t) + num_parts() * sizeof(std::uint32_t));
  }

  /// False, at all processes, if one cannot. MPI's own shared memory leaves them waiting for
  /// each other then.
  bool allocate() {
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
    part_numbers_ = reinterpret_cast<std::uint32_t *>(words);
    return true;
  }

  MPI_Comm comm_ = MPI_COMM_NULL;
  platform::SharedMemory memory_;
  int rank_ = 0, size_ = 1;
  std::uint64_t capacity_ = 0;
  std::vector<std::span<std::uint64_t>> segments_;  ///< by rank
  /// By rank and part, in the same memory: the reduction that the words there are of.
  std::uint32_t *part_numbers_ = nullptr;
  std::uint32_t number_ = 0;          ///< of the reduction at work
  std::vector<std::uint64_t> alone_;  ///< of a process that shares with none
};

/// MPI's own handler of errors ends the job.
class MpiTeam : public Team {
 public:
  MpiTeam() {
    MPI_Comm_rank(MPI_COMM_WORLD, &rank_);
    MPI_Comm_size(MPI_COMM_WORLD, &size_);
    MPI_Comm host = MPI_COMM_NULL;
    MPI_Comm_split_type(MPI_COMM_WORLD, MPI_COMM_TYPE_SHARED, rank_, MPI_INFO_NULL, &host);
    MPI_Comm_rank(host, &local_rank_);
    MPI_Comm_free(&host);
  }
  ~MpiTeam() override {
    if (hosts_ != MPI_COMM_NULL) MPI_Comm_free(&hosts_);
  }
  std::uint32_t rank() const override { return static_cast<std::uint32_t>(rank_); }
  std::uint32_t size() const override { return static_cast<std::uint32_t>(size_); }
  std::uint32_t local_rank() const { return static_cast<std::uint32_t>(local_rank_); }

  std::vector<std::string> all_gather(const std::string &text) override {
    const auto count = static_cast<std::size_t>(size_);
    const int length = static_cast<int>(text.size());
    std::vector<int> lengths(count), begins(count);
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Iallgather(&length, 1, MPI_INT, lengths.data(), 1, MPI_INT, MPI_COMM_WORLD, &request);
    wait_for({&request, 1});
    std::int64_t sum = 0;
    for (std::size_t rank = 0; rank < count; ++rank) {
      begins[rank] = static_cast<int>(sum);
      sum += lengths[rank];
      if (sum > std::numeric_limits<int>::max())
        throw std::length_error("the ranks' texts are too long for MPI");
    }
    std::string all(static_cast<std::size_t>(sum), '\0');
    MPI_Iallgatherv(text.data(), length, MPI_CHAR, all.data(), lengths.data(), begins.data(),
                    MPI_CHAR, MPI_COMM_WORLD, &request);
    wait_for({&request, 1});
    std::vector<std::string> texts;
    for (std::size_t rank = 0; rank < count; ++rank)
      texts.push_back(all.substr(static_cast<std::size_t>(begins[rank]),
                                 static_cast<std::size_t>(lengths[rank])));
    return texts;
  }

  /// Within hosts first, then between their first processes, which work on a piece while the hosts
  /// make the next one.
  void reduce(std::size_t count, Reduction how, Receiver who, const MakeWords &make,
              const TakeWords &take) override {
    if (!host_) meet_hosts();
    const std::size_t capacity = host_->capacity();
    std::array<Piece, 2> pieces;
    std::size_t number = 0;
    for (std::size_t begin = 0; begin < count; begin += capacity, ++number) {
      const std::size_t size = std::min(capacity, count - begin);
      if (who == Receiver::kAll) {
        reduce_for_all(begin, size, how, make, take);
      } else if (num_hosts_ == 1) {
        host_->reduce(begin, size, how, make, take);
      } else {
        Piece &piece = pieces[number % 2];
        finish(piece, take);
        piece.begin = begin;
        piece.words.resize(host_->is_first() ? size : 0);
        host_->reduce(begin, size, how, make, copy_to(piece.words, begin));
        if (!host_->is_first()) continue;
        MPI_Ireduce(rank_ == 0 ? MPI_IN_PLACE : piece.words.data(), piece.words.data(),
                    to_count(size, how), to_type(how), to_op(how), 0, hosts_, &piece.request);
      }
    }
    for (std::size_t i = 0; i < 2; ++i) finish(pieces[(number + i) % 2], take);
  }

  void exchange(std::span<const Outgoing> sent, std::span<const Incoming> received) override {
    std::vector<MPI_Request> requests;
    for (const Outgoing &message : sent) {
      for_pieces(message.bytes, [&](std::span<const std::byte> piece) {
        requests.push_back(MPI_REQUEST_NULL);
        MPI_Isend(piece.data(), static_cast<int>(piece.size()), MPI_BYTE,
                  static_cast<int>(message.rank), 0, MPI_COMM_WORLD, &requests.back());
      });
    }
    for (const Incoming &message : received) {
      for_pieces(message.bytes, [&](std::span<std::byte> piece) {
        requests.push_back(MPI_REQUEST_NULL);
        MPI_Irecv(piece.data(), static_cast<int>(piece.size()), MPI_BYTE,
                  static_cast<int>(message.rank), 0, MPI_COMM_WORLD, &requests.back());
      });
    }
    wait_for(requests);
  }

 private:
  struct Piece {
    std::size_t begin = 0;
    std::vector<std::uint64_t> words;
    MPI_Request request = MPI_REQUEST_NULL;
  };

  /// Words from `begin` on.
  static TakeWords copy_to(std::span<std::uint64_t> words, std::size_t begin) {
    return [words, begin](std::size_t from, std::span<const std::uint64_t> part) {
      std::ranges::copy(part, words.subspan(from - begin, part.size()).begin());
    };
  }

  void reduce_for_all(std::size_t begin, std::size_t size, Reduction how, const MakeWords &make,
                      const TakeWords &take) {
    const std::span<std::uint64_t> words = host_->first().first(size);
    host_->reduce(begin, size, how, make, copy_to(words, begin));
    if (num_hosts_ > 1 && host_->is_first()) {
      MPI_Request request = MPI_REQUEST_NULL;
      MPI_Iallreduce(MPI_IN_PLACE, words.data(), to_count(size, how), to_type(how), to_op(how),
                     hosts_, &request);
      wait_for({&request, 1});
    }
    host_->wait_for_all();
    host_->for_parts(0, size, [&](std::size_t from, std::size_t count) {
      take(begin + from, words.subspan(from, count));
    });
    host_->wait_for_all();
  }

  static MPI_Op to_op(Reduction how) { return how == Reduction::kOr ? MPI_BOR : MPI_MIN; }
  static MPI_Datatype to_type(Reduction how) {
    return how == Reduction::kMinOfHalves ? MPI_UINT32_T : MPI_UINT64_T;
  }
  static int to_count(std::size_t words, Reduction how) {
    return static_cast<int>(how == Reduction::kMinOfHalves ? 2 * words : words);
  }

  void finish(Piece &piece, const TakeWords &take) const {
    if (piece.words.empty()) return;
    wait_for({&piece.request, 1});
    if (rank_ == 0) take(piece.begin, piece.words);
    piece.words.clear();
  }

  /// Before the first reduction: not every job has one.
  void meet_hosts() {
    host_.emplace();
    MPI_Comm_split(MPI_COMM_WORLD, host_->is_first() ? 0 : MPI_UNDEFINED, rank_, &hosts_);
    if (hosts_ != MPI_COMM_NULL) MPI_Comm_size(hosts_, &num_hosts_);
    MPI_Bcast(&num_hosts_, 1, MPI_INT, 0, MPI_COMM_WORLD);
  }

  int rank_ = 0, size_ = 1, local_rank_ = 0;
  std::optional<HostWords> host_;
  MPI_Comm hosts_ = MPI_COMM_NULL;  ///< the hosts' first processes
  int num_hosts_ = 1;
};

std::unique_ptr<MpiTeam> team_of_job;

std::string checksum;  ///< of the command line

/// Without asking MPI, which takes long to begin: the variables that its launchers set.
bool has_launcher() {
  for (const char *name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "PMI_RANK"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

/// Whether all ranks come to their end, within a few seconds.
bool all_end() {
  MPI_Request request = MPI_REQUEST_NULL;
  MPI_Ibarrier(MPI_COMM_WORLD, &request);
  int done = 0;
  for (int tries = 0; tries < 500 && done == 0; ++tries) {
    MPI_Test(&request, &done, MPI_STATUS_IGNORE);
    if (done == 0) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return done != 0;
}

}  // namespace

MpiJob::MpiJob(int *argc, char ***argv) {
  if (!has_launcher()) return;
  MPI_Init(argc, argv);
  std::uint32_t crc = 0;
  for (int i = 1; i < *argc; ++i) {
    const std::string_view word = (*argv)[i];
    crc = update_crc(crc, std::as_bytes(std::span(word.data(), word.size() + 1)));
  }
  checksum = std::to_string(crc);
  team_of_job = std::make_unique<MpiTeam>();
  if (team_of_job->size() == 1) return;
  if (team_of_job->rank() != 0) platform::fall_silent();
}

MpiJob::~MpiJob() {
  if (team_of_job) finish(1);
}

int MpiJob::finish(int status) {
  if (!team_of_job) return status;
  if (status != 0 && !all_end()) {
    const std::string line = "isowave: rank " + std::to_string(team_of_job->rank()) +
                             " has failed while others go on: the job ends\n";
    platform::write_error_aloud(line);
    MPI_Abort(MPI_COMM_WORLD, 1);
  }
  if (status == 0) {
    MPI_Request request = MPI_REQUEST_NULL;
    MPI_Ibarrier(MPI_COMM_WORLD, &request);
    wait_for({&request, 1});
  }
  team_of_job.reset();
  MPI_Finalize();
  return status;
}

std::string MpiJob::command_line() {
  return checksum;
}

Team *MpiJob::team() {
  return team_of_job && team_of_job->size() > 1 ? team_of_job.get() : nullptr;
}

std::uint32_t MpiJob::local_rank() {
  return team_of_job ? team_of_job->local_rank() : 0;
}

std::unique_ptr<SharedFile> MpiJob::create_file(const std::filesystem::path &target) {
  return create_mpi_file(*team_of_job, target);
}

}  // namespace isowave::core::tools

#else

namespace isowave::core::tools {

MpiJob::MpiJob(int *, char ***) {}
MpiJob::~MpiJob() = default;
int MpiJob::finish(int status) {
  return status;
}
std::string MpiJob::command_line() {
  return {};
}
std::uint32_t MpiJob::local_rank() {
  return 0;
}
std::unique_ptr<SharedFile> MpiJob::create_file(const std::filesystem::path &) {
  return nullptr;
}

}  // namespace isowave::core::tools

#endif
