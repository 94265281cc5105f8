#include "tools/isowave/mpi_file.hpp"

#ifdef ISOWAVE_HAS_MPI

#include <mpi.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/atomic_file.hpp"
#include "core/platform/new_file.hpp"
#include "core/platform/shared_memory.hpp"
#include "core/platform/signals.hpp"
#include "core/platform/streams.hpp"

namespace isowave::core::tools {

namespace {

/// The same text at processes that see the same file by that name; empty if there is none.
std::string identity_of(const std::string &name) {
  std::error_code failure;
  const std::string system = platform::system_identity(),
                    file = platform::identity_of(name, failure);
  return system.empty() || failure ? "" : system + " " + file;
}

/// Rank 0 has an AtomicFile, which each process opens by itself, so that one that cannot leaves no
/// other waiting. On one host, the file has no name before its commit: whatever ends the processes,
/// nothing is left. Several hosts need a name.
class MpiFile : public SharedFile {
 public:
  MpiFile(Team &team, const std::filesystem::path &target) : team_(team), target_(target.string()) {
    together(team, [&] {
      if (is_first()) own_.emplace(target);
    });
    std::string name = of_first(own_ ? own_->name_on_this_system().string() : "");
    if (!is_seen_by_all(name)) {
      together(team, [&] {
        if (is_first()) name = own_->name_anywhere().string();
      });
      name = of_first(name);
      platform::remove_at_end(name);  // if all are killed at once, it stays
    }
    try {
      together(team, [&] {
        check([&] {
          return MPI_File_open(MPI_COMM_SELF, name.c_str(), MPI_MODE_WRONLY, MPI_INFO_NULL, &file_);
        });
      });
    } catch (...) {
      close();
      throw;
    }
  }
  ~MpiFile() override { close(); }
  MpiFile(const MpiFile &) = delete;
  MpiFile &operator=(const MpiFile &) = delete;

  void write(std::uint64_t offset, std::span<const std::byte> bytes) override {
    while (!bytes.empty()) {
      MPI_Status status;
      int count = 0;
      check([&] {
        const platform::HushedErrors hushed;  // Open MPI prints a line of its own
        return MPI_File_write_at(file_, static_cast<MPI_Offset>(offset), bytes.data(),
                                 static_cast<int>(std::min(bytes.size(), kMostMpiBytes)), MPI_BYTE,
                                 &status);
      });
      // On a full disk, it may write what fits, and say why not the rest only when asked again.
      MPI_Get_count(&status, MPI_BYTE, &count);
      if (count <= 0) fail(std::strerror(errno != 0 ? errno : EIO));
      bytes = bytes.subspan(static_cast<std::size_t>(count));
      offset += static_cast<std::uint64_t>(count);
    }
  }

  void commit() override {
    together(team_, [&] {
      check([&] { return MPI_File_sync(file_); });
      check([&] { return MPI_File_close(&file_); });
    });
    together(team_, [&] {
      if (is_first()) own_->commit();
    });
  }

 private:
  bool is_first() const { return team_.rank() == 0; }
  [[noreturn]] void fail(const char *reason) const {
    throw Error("{}: cannot write: {}", target_, reason);
  }
  template <class Call>
  void check(const Call &call) const {
    errno = 0;
    const int result = call();
    if (result == MPI_SUCCESS) return;
    if (errno != 0) fail(std::strerror(errno));
    std::array<char, MPI_MAX_ERROR_STRING + 1> text{};
    int length = 0;
    MPI_Error_string(result, text.data(), &length);
    fail(text.data());
  }
  std::string of_first(const std::string &text) { return team_.all_gather(text).front(); }
  /// ISOWAVE_HOST_RANKS: as if there were several hosts.
  bool is_seen_by_all(const std::string &name) {
    const bool may_be = std::getenv("ISOWAVE_HOST_RANKS") == nullptr;
    const std::vector<std::string> seen = team_.all_gather(may_be ? identity_of(name) : "");
    return !seen.front().empty() && std::ranges::count(seen, seen.front()) == std::ssize(seen);
  }
  void close() {
    if (file_ != MPI_FILE_NULL) MPI_File_close(&file_);
    own_.reset();
  }

  Team &team_;
  std::string target_;             ///< as asked for
  std::optional<AtomicFile> own_;  ///< rank 0's
  MPI_File file_ = MPI_FILE_NULL;
};

}  // namespace

std::unique_ptr<SharedFile> create_mpi_file(Team &team, const std::filesystem::path &target) {
  return std::make_unique<MpiFile>(team, target);
}

}  // namespace isowave::core::tools

#endif
