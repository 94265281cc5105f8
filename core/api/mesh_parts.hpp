#pragma once
// Private to core/api: meshes of its users and of core, from the host and from devices.

#include <string>
#include <string_view>

#include "core/mesh/mesh.hpp"
#include "core/mesh/mesh_changes.hpp"
#include "core/mesh/mesh_file.hpp"
#include "core/zfp/zfp_stream.hpp"
#include "isowave/mesh.hpp"

namespace isowave {

/// The level of detail that is asked for.
///
/// Throws  core::Error: there is none
const core::CompressedVolume &level_to_extract(const Volume &volume, const ExtractOptions &options);

/// Calls options.progress of the step `what`. Empty if there is none.
core::Progress progress_of(const ExtractOptions &options, std::string_view what);

core::MeshChanges changes_of(const ExtractOptions &options);

/// Fills a mesh of users.
class MeshOfUser : public core::MeshSink {
 public:
  void begin(const core::MeshSize &size) override;
  void add(const core::MeshPart &part) override;

  Mesh mesh{};
};

/// Makes a mesh. extract_to: gives its parts to a sink.
template <class ExtractTo>
Mesh extracted(const ExtractTo &extract_to) {
  MeshOfUser sink;
  sink.mesh.simplify_error = extract_to(sink).error;
  return std::move(sink.mesh);
}

/// Makes a file. Returns its notice.
template <class ExtractTo>
std::string extracted_to_file(const std::filesystem::path &path, const ExtractOptions &options,
                              const ExtractTo &extract_to) {
  core::MeshFile file(path);
  const core::SimplifiedMesh simplified = extract_to(file);
  file.commit(progress_of(options, "writing"));
  return options.simplify < 1 ? describe(simplified) + file.notice() : file.notice();
}

}  // namespace isowave
