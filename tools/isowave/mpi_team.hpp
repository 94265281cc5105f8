#pragma once
// The processes that mpirun has started, as a team. Without MPI in the build, or without mpirun,
// there is none.

#include <cstdint>
#include <memory>
#include <string>

#include "core/bricks/team.hpp"

namespace isowave::core::tools {

/// Of main(): MPI from its beginning to its end.
class MpiJob {
 public:
  /// Where mpirun has started more than one process, joins them. All but rank 0 fall silent.
  MpiJob(int *argc, char ***argv);
  ~MpiJob();
  MpiJob(const MpiJob &) = delete;
  MpiJob &operator=(const MpiJob &) = delete;

  /// Ends with an exit status. Where this rank fails and the others go on, it ends the job.
  int finish(int status);

  /// None: this process is alone.
  static Team *team();
  /// Where and how this process was started: a checksum.
  static std::string command_line();
  /// Number of this process among those of its host.
  static std::uint32_t local_rank();
};

}  // namespace isowave::core::tools
