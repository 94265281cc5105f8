#include "tools/isowave/mpi_team.hpp"

#ifdef ISOWAVE_HAS_MPI

#include <mpi.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <thread>

#include "core/base/error.hpp"
#include "core/platform/signals.hpp"
#include "core/platform/streams.hpp"
#include "core/zfp/zfp_trailer.hpp"
#include "tools/isowave/host_words.hpp"
#include "tools/isowave/mpi_file.hpp"
#include "tools/isowave/mpi_wait.hpp"

namespace isowave::core::tools {

namespace {

template <class Byte, class Use>
void for_pieces(std::span<Byte> bytes, const Use &use) {
  for (; !bytes.empty(); bytes = bytes.subspan(std::min(bytes.size(), kMostMpiBytes)))
    use(bytes.first(std::min(bytes.size(), kMostMpiBytes)));
}

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

  std::uint64_t given_bytes() const override { return host_ ? host_->given_bytes() : 0; }

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
    host_->for_parts(size, [&](std::size_t from, std::size_t count) {
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
