#pragma once
// A file that the processes of mpirun write together, by MPI-IO.

#ifdef ISOWAVE_HAS_MPI

#include <cstddef>
#include <filesystem>
#include <memory>

#include "core/base/team.hpp"
#include "core/zfp/shared_file.hpp"

namespace isowave::core::tools {

/// MPI counts bytes by an int.
inline constexpr std::size_t kMostMpiBytes = std::size_t{1} << 30;

/// See MpiJob::create_file().
std::unique_ptr<SharedFile> create_mpi_file(Team &team, const std::filesystem::path &target);

}  // namespace isowave::core::tools

#endif
