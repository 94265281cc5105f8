#pragma once
// Files of triangle meshes: PLY, STL, OBJ, VTP, glTF. They are written here, since the libraries
// that write them (Assimp, VTK) want the whole mesh in memory, and a surface may be larger.

#include <filesystem>
#include <limits>
#include <span>
#include <string>

#include "core/io/atomic_file.hpp"
#include "core/mesh/mesh.hpp"
#include "core/volume/voxel_chunks.hpp"

namespace isowave::core {

enum class MeshFormat {
  kPly,   ///< binary
  kStl,   ///< binary; a triangle has its own three vertices and a normal of its own
  kObj,   ///< text
  kVtp,   ///< VTK's XML, with binary data behind it
  kGltf,  ///< with its data in itself, as base64
  kGlb    ///< glTF in one binary file
};

/// By the name's ending, in any case.
///
/// Throws  Error naming the endings that there are
MeshFormat mesh_format_of(const std::filesystem::path &path);

/// A file without a name beside `target`, of what is too large for memory, and then read anywhere.
/// It vanishes with this object.
template <class T>
class Spool {
 public:
  explicit Spool(const std::filesystem::path &target) : file_(target) {}
  ~Spool() { unmap(); }
  Spool(const Spool &) = delete;
  Spool &operator=(const Spool &) = delete;

  /// Throws  Error: disk full and such
  void add(std::span<const T> values) {
    file_.write(std::as_bytes(values));
    count_ += values.size();
  }
  /// All that was added; valid as long as the spool. Nothing may be added afterwards.
  ///
  /// Throws  Error
  std::span<const T> all();

 private:
  void unmap() noexcept;

  AtomicFile file_;
  std::size_t count_ = 0;
  const void *mapped_ = nullptr;
};

/// Takes a mesh, however large, and writes it to a file that appears whole or not at all. Positions
/// that float32 does not hold are float64 in PLY, OBJ and VTP; in glTF and STL they are float32
/// from offset() on, which glTF has as a node's translation and STL in its header's comment. Takes
/// disk space for the mesh twice while it is at work, and memory for what the system likes to keep
/// of it.
class MeshFile : public MeshSink {
 public:
  /// path    its ending says the format
  /// Throws  Error: the name has another ending, or the file cannot be written
  explicit MeshFile(const std::filesystem::path &path);

  void begin(const MeshSize &) override {}
  void add(const MeshPart &part) override;
  /// Writes the file and gives it its name. Call once, after all parts.
  ///
  /// Throws  Error: it cannot be written, or the mesh is larger than the format allows
  void commit(const Progress &progress = {});

  /// Offset that makes world positions of the file's positions [world units]; 0 if they are world
  /// positions. Call it after all parts.
  glm::dvec3 offset() const;
  /// One line for users if programs that read the file do not know of its offset; else empty.
  std::string notice() const;

 private:
  class Writer;

  std::filesystem::path path_;
  MeshFormat format_;
  AtomicFile file_;
  bool is_float32_ = true;  ///< all positions so far
  glm::dvec3 least_{std::numeric_limits<double>::infinity()}, largest_ = -least_;
  Spool<glm::dvec3> vertices_;
  Spool<glm::vec3> normals_;
  Spool<Triangle> triangles_;
};

}  // namespace isowave::core
