#include "tools/isowave/mpi_team.hpp"

#ifdef ISOWAVE_HAS_MPI

#include <fcntl.h>
#include <mpi.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <limits>
#include <stdexcept>
#include <string_view>
#include <thread>

#include "core/zfp/zfp_trailer.hpp"

namespace isowave::core::tools {

namespace {

/// MPI itself waits as fast as a processor can, which takes that from whoever draws on it.
void wait_for(std::span<MPI_Request> requests) {
  constexpr std::chrono::milliseconds kFast{1};
  constexpr std::chrono::microseconds kNap{50};
  const auto begin = std::chrono::steady_clock::now();
  for (int done = 0; done == 0;) {
    MPI_Testall(static_cast<int>(requests.size()), requests.data(), &done, MPI_STATUSES_IGNORE);
    if (done == 0 && std::chrono::steady_clock::now() - begin > kFast)
      std::this_thread::sleep_for(kNap);
  }
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

  void begin_reduction(std::span<std::uint64_t> words, Reduction how, Receiver who) override {
    requests_.push_back(MPI_REQUEST_NULL);
    const int count = static_cast<int>(words.size());
    const MPI_Op op = how == Reduction::kMin ? MPI_MIN : MPI_BOR;
    if (who == Receiver::kAll) {
      MPI_Iallreduce(MPI_IN_PLACE, words.data(), count, MPI_UINT64_T, op, MPI_COMM_WORLD,
                     &requests_.back());
    } else {
      MPI_Ireduce(rank_ == 0 ? MPI_IN_PLACE : words.data(), words.data(), count, MPI_UINT64_T, op,
                  0, MPI_COMM_WORLD, &requests_.back());
    }
  }

  void finish_reductions() override {
    wait_for(requests_);
    requests_.clear();
  }

 private:
  int rank_ = 0, size_ = 1, local_rank_ = 0;
  std::vector<MPI_Request> requests_;
};

std::unique_ptr<MpiTeam> team_of_job;
std::string checksum;  ///< of the command line
int loud_stderr = -1;  ///< of a rank that is silent

/// Without asking MPI, which takes long to begin: the variables that its launchers set.
bool has_launcher() {
  for (const char *name : {"OMPI_COMM_WORLD_SIZE", "PMIX_RANK", "PMI_SIZE", "PMI_RANK"}) {
    if (std::getenv(name) != nullptr) return true;
  }
  return false;
}

void fall_silent() {
  std::fflush(nullptr);
  loud_stderr = ::dup(STDERR_FILENO);
  const int nowhere = ::open("/dev/null", O_WRONLY | O_CLOEXEC);
  if (nowhere < 0) return;
  ::dup2(nowhere, STDOUT_FILENO);
  ::dup2(nowhere, STDERR_FILENO);
  ::close(nowhere);
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
  if (team_of_job->rank() != 0) fall_silent();
}

MpiJob::~MpiJob() {
  if (team_of_job) finish(1);
}

int MpiJob::finish(int status) {
  if (!team_of_job) return status;
  if (status != 0 && !all_end()) {
    const std::string line = "isowave: rank " + std::to_string(team_of_job->rank()) +
                             " has failed while others go on: the job ends\n";
    if (::write(loud_stderr < 0 ? STDERR_FILENO : loud_stderr, line.data(), line.size()) < 0)
      status = 1;  // nobody can be told
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
Team *MpiJob::team() {
  return nullptr;
}
std::uint32_t MpiJob::local_rank() {
  return 0;
}

}  // namespace isowave::core::tools

#endif
