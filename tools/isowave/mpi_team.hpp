#pragma once
// The processes that mpirun has started, as a team. Without MPI in the build, or without mpirun,
// there is none.

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "core/base/team.hpp"
#include "core/zfp/shared_file.hpp"

namespace isowave::core::tools {

/// MPI from its beginning to its end; main() has one.
class MpiJob {
 public:
  /// Joins the processes if mpirun has started more than one. All but rank 0 fall silent.
  MpiJob(int *argc, char ***argv);
  ~MpiJob();
  MpiJob(const MpiJob &) = delete;
  MpiJob &operator=(const MpiJob &) = delete;

  /// Ends with an exit status. Where this rank fails and the others go on, it ends the job.
  int finish(int status);

  /// None: this process is alone.
#ifdef ISOWAVE_HAS_MPI
  static Team *team();
#else
  static Team *team() {
    return nullptr;
  }  // and compilers leave out what teams do
#endif
  /// A checksum of the place and command line of this process.
  static std::string command_line();
  /// Number of this process among those of its host.
  static std::uint32_t local_rank();
  /// A file that all processes of the team write by MPI-IO. It has no name before its
  /// commit(), or a temporary one. The target is a regular file, or none.
  ///
  /// Throws  Error at all of them
  static std::unique_ptr<SharedFile> create_file(const std::filesystem::path &target);
};

}  // namespace isowave::core::tools
