#include "core/mesh/mesh_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cerrno>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <iterator>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <system_error>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/platform/memory.hpp"

namespace isowave::core {

namespace {

static_assert(std::endian::native == std::endian::little, "binary files are little endian");
static_assert(sizeof(glm::vec3) == 12 && sizeof(glm::dvec3) == 24 && sizeof(Triangle) == 12);

constexpr std::array kEndings = {
    std::pair(".ply", MeshFormat::kPly),   std::pair(".stl", MeshFormat::kStl),
    std::pair(".obj", MeshFormat::kObj),   std::pair(".vtp", MeshFormat::kVtp),
    std::pair(".gltf", MeshFormat::kGltf), std::pair(".glb", MeshFormat::kGlb)};

glm::vec3 facet_normal(const glm::dvec3 &a, const glm::dvec3 &b, const glm::dvec3 &c) {
  const glm::dvec3 normal = glm::cross(b - a, c - a);
  const double length = glm::length(normal);
  return length > 0 ? glm::vec3(normal / length) : glm::vec3(0);
}

std::string offset_text(const glm::dvec3 &offset) {
  return fmt::format("{} {} {} to x y z", offset.x, offset.y, offset.z);
}

}  // namespace

MeshFormat mesh_format_of(const std::filesystem::path &path) {
  const std::string name = lower_case(path.filename().string());
  for (const auto &[ending, format] : kEndings) {
    if (name.size() > std::strlen(ending) && name.ends_with(ending)) return format;
  }
  throw Error("{}: no format of meshes: end the name in .ply, .stl, .obj, .vtp, .gltf or .glb",
              path.string());
}

template <class T>
std::span<const T> Spool<T>::all() {
  if (count_ == 0) return {};
  if (mapped_ == nullptr) {
    std::error_code failure;
    if (std::fflush(file_.stream()) == 0)
      mapped_ = platform::map_file(file_.stream(), count_ * sizeof(T), failure);
    else
      failure.assign(errno, std::generic_category());
    if (failure)
      throw Error("{}: cannot write: its scratch: {}", file_.target().string(), failure.message());
  }
  return {static_cast<const T *>(mapped_), count_};
}

template <class T>
void Spool<T>::unmap() noexcept {
  if (mapped_ != nullptr) platform::unmap_file(mapped_, count_ * sizeof(T));
}

template class Spool<glm::dvec3>;
template class Spool<glm::vec3>;
template class Spool<Triangle>;

/// The formats.
class MeshFile::Writer {
 public:
  Writer(MeshFile &mesh, const Progress &progress)
      : file_(mesh.file_),
        path_(mesh.path_),
        progress_(progress),
        is_float32_(mesh.is_float32_),
        offset_(mesh.offset()),
        vertices_(mesh.vertices_.all()),
        normals_(mesh.normals_.all()),
        triangles_(mesh.triangles_.all()) {}

  void write(MeshFormat format) {
    total_ = vertices_.size() + normals_.size() + triangles_.size();
    switch (format) {
      case MeshFormat::kPly:
        return write_ply();
      case MeshFormat::kStl:
        return write_stl();
      case MeshFormat::kObj:
        return write_obj();
      case MeshFormat::kVtp:
        return write_vtp();
      case MeshFormat::kGltf:
        return write_gltf();
      case MeshFormat::kGlb:
        return write_glb();
    }
  }

 private:
  /// Appends the bytes of values; what is put together goes to the file by and by.
  template <class... Values>
  void put(const Values &...values) {
    const auto append = [this](const auto &value) {
      const auto *bytes = reinterpret_cast<const char *>(&value);
      pending_.append(bytes, sizeof(value));
    };
    (append(values), ...);
  }
  void flush() {
    file_.write(pending_);
    pending_.clear();
  }
  /// Calls each(i) for all entries, and writes out what that puts together.
  template <class Each>
  void for_each(std::size_t count, const Each &each) {
    constexpr std::size_t kAtOnce = 1u << 14;
    for (std::size_t i = 0; i < count; ++i) {
      each(i);
      if ((i + 1) % kAtOnce != 0 && i + 1 != count) continue;
      flush();
      done_ += i % kAtOnce + 1;
      if (progress_)
        progress_(static_cast<std::uint32_t>(
                      std::min(done_ * 1000 / std::max<std::size_t>(total_, 1), std::size_t{999})),
                  1000);
    }
  }
  template <class T>
  void write_all(std::span<const T> values) {
    for_each(values.size(), [&](std::size_t i) { put(values[i]); });
  }
  bool has_normals() const { return !normals_.empty(); }
  /// In as many bits as positions need.
  void put_position(std::size_t i) {
    if (is_float32_)
      put(glm::vec3(vertices_[i]));
    else
      put(vertices_[i]);
  }
  /// From offset_, for formats that have float32 alone.
  glm::vec3 local(std::size_t i) const { return glm::vec3(vertices_[i] - offset_); }

  void write_ply() {
    std::string header = fmt::format(
        "ply\nformat binary_little_endian 1.0\ncomment by isowave\nelement vertex {0}\n"
        "property {1} x\nproperty {1} y\nproperty {1} z\n",
        vertices_.size(), is_float32_ ? "float" : "double");
    if (has_normals()) header += "property float nx\nproperty float ny\nproperty float nz\n";
    const bool fits_int = vertices_.size() <= std::numeric_limits<std::int32_t>::max();
    header += fmt::format("element face {}\nproperty list uchar {} vertex_indices\nend_header\n",
                          triangles_.size(), fits_int ? "int" : "uint");
    file_.write(header);
    for_each(vertices_.size(), [&](std::size_t i) {
      put_position(i);
      if (has_normals()) put(normals_[i]);
    });
    for_each(triangles_.size(), [&](std::size_t i) { put(std::uint8_t{3}, triangles_[i]); });
  }

  void write_stl() {
    if (triangles_.size() > std::numeric_limits<std::uint32_t>::max())
      throw Error("{}: an STL file has at most 2^32 - 1 triangles, the surface {}: take .ply",
                  path_.string(), triangles_.size());
    std::array<char, 80> title{};
    std::string text = "binary STL by isowave";  // "solid" would say that it is text
    if (offset_ != glm::dvec3(0)) text = fmt::format("isowave STL, add {}", offset_text(offset_));
    text.copy(title.data(), title.size());
    put(title, static_cast<std::uint32_t>(triangles_.size()));
    flush();
    for_each(triangles_.size(), [&](std::size_t i) {
      const auto &[a, b, c] = triangles_[i];
      put(facet_normal(vertices_[a], vertices_[b], vertices_[c]), local(a), local(b), local(c),
          std::uint16_t{0});
    });
  }

  void write_obj() {
    file_.write("# by isowave\n");
    const auto line = [this](std::string_view name, const auto &v) {
      fmt::format_to(std::back_inserter(pending_), "{} {} {} {}\n", name, v.x, v.y, v.z);
    };
    for_each(vertices_.size(), [&](std::size_t i) {
      if (is_float32_)
        line("v", glm::vec3(vertices_[i]));
      else
        line("v", vertices_[i]);
    });
    for_each(normals_.size(), [&](std::size_t i) { line("vn", normals_[i]); });
    for_each(triangles_.size(), [&](std::size_t i) {
      pending_ += 'f';
      for (const std::uint32_t vertex : triangles_[i]) {
        const std::uint64_t number = std::uint64_t{vertex} + 1;
        if (has_normals()) {
          fmt::format_to(std::back_inserter(pending_), " {0}//{0}", number);
        } else {
          fmt::format_to(std::back_inserter(pending_), " {}", number);
        }
      }
      pending_ += '\n';
    });
  }

  void write_vtp() {
    const std::uint64_t num_vertices = vertices_.size(), num_triangles = triangles_.size();
    const bool is_long = 3 * num_triangles > std::numeric_limits<std::int32_t>::max() ||
                         num_vertices > std::numeric_limits<std::int32_t>::max();
    const std::string_view integer = is_long ? "Int64" : "Int32";
    const std::uint64_t integer_bytes = is_long ? 8 : 4;
    std::uint64_t offset = 0;  // behind the '_'
    const auto array = [&](std::string_view type, std::string_view attributes,
                           std::uint64_t bytes) {
      std::string text =
          fmt::format("<DataArray type=\"{}\" {} format=\"appended\" offset=\"{}\"/>\n", type,
                      attributes, offset);
      offset += sizeof(std::uint64_t) + bytes;
      return text;
    };
    std::string head = fmt::format(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"PolyData\" version=\"1.0\" "
        "byte_order=\"LittleEndian\" header_type=\"UInt64\">\n<PolyData>\n"
        "<Piece NumberOfPoints=\"{}\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" "
        "NumberOfPolys=\"{}\">\n",
        num_vertices, num_triangles);
    head += "<Points>\n";
    const std::uint64_t position_bytes = (is_float32_ ? 12 : 24) * num_vertices;
    head += array(is_float32_ ? "Float32" : "Float64", "Name=\"Points\" NumberOfComponents=\"3\"",
                  position_bytes);
    head += "</Points>\n";
    if (has_normals()) {
      head += "<PointData Normals=\"Normals\">\n";
      head += array("Float32", "Name=\"Normals\" NumberOfComponents=\"3\"", 12 * num_vertices);
      head += "</PointData>\n";
    }
    head += "<Polys>\n";
    head += array(integer, "Name=\"connectivity\"", 3 * integer_bytes * num_triangles);
    head += array(integer, "Name=\"offsets\"", integer_bytes * num_triangles);
    head += "</Polys>\n";
    head += "</Piece>\n</PolyData>\n<AppendedData encoding=\"raw\">\n_";
    file_.write(head);
    const auto put_integer = [&](std::uint64_t value) {
      if (is_long)
        put(static_cast<std::int64_t>(value));
      else
        put(static_cast<std::int32_t>(value));
    };
    put(position_bytes);
    for_each(num_vertices, [&](std::size_t i) { put_position(i); });
    if (has_normals()) put(12 * num_vertices);
    write_all(normals_);
    put(3 * integer_bytes * num_triangles);
    for_each(num_triangles, [&](std::size_t i) {
      for (const std::uint32_t vertex : triangles_[i]) put_integer(vertex);
    });
    put(integer_bytes * num_triangles);
    for_each(num_triangles, [&](std::size_t i) { put_integer(3 * (std::uint64_t{i} + 1)); });
    flush();
    file_.write("\n</AppendedData>\n</VTKFile>\n");
  }

  std::uint64_t gltf_bytes() const {
    return 12 * (std::uint64_t{vertices_.size()} + normals_.size() + triangles_.size());
  }
  nlohmann::ordered_json gltf_document() {
    nlohmann::ordered_json document = {{"asset", {{"version", "2.0"}, {"generator", "isowave"}}}};
    if (triangles_.empty()) return document;  // accessors without elements are not allowed
    if (gltf_bytes() > std::numeric_limits<std::uint32_t>::max() - 4096)
      throw Error("{}: glTF holds at most 4 GiB, and the surface has {} bytes: take .ply or .vtp",
                  path_.string(), gltf_bytes());
    glm::vec3 least = local(0), largest = least;
    for (std::size_t i = 0; i < vertices_.size(); ++i) {
      least = glm::min(least, local(i));
      largest = glm::max(largest, local(i));
    }
    constexpr int kFloat = 5126, kUint = 5125, kVertices = 34962, kIndices = 34963;
    nlohmann::ordered_json views = nlohmann::ordered_json::array(), accessors = views;
    std::uint64_t offset = 0;
    const auto add = [&](std::uint64_t bytes, int target, int type, std::uint64_t count,
                         const char *shape) {
      views.push_back(
          {{"buffer", 0}, {"byteOffset", offset}, {"byteLength", bytes}, {"target", target}});
      accessors.push_back({{"bufferView", views.size() - 1},
                           {"componentType", type},
                           {"count", count},
                           {"type", shape}});
      offset += bytes;
    };
    add(12 * vertices_.size(), kVertices, kFloat, vertices_.size(), "VEC3");
    accessors.back()["min"] = {least.x, least.y, least.z};
    accessors.back()["max"] = {largest.x, largest.y, largest.z};
    nlohmann::ordered_json attributes = {{"POSITION", 0}};
    if (has_normals()) {
      add(12 * normals_.size(), kVertices, kFloat, normals_.size(), "VEC3");
      attributes["NORMAL"] = 1;
    }
    add(12 * triangles_.size(), kIndices, kUint, 3 * triangles_.size(), "SCALAR");
    document["scene"] = 0;
    document["scenes"] = {{{"nodes", {0}}}};
    document["nodes"] = {{{"mesh", 0}}};
    if (offset_ != glm::dvec3(0))
      document["nodes"][0]["translation"] = {offset_.x, offset_.y, offset_.z};
    document["meshes"] = {
        {{"primitives", {{{"attributes", attributes}, {"indices", accessors.size() - 1}}}}}};
    document["buffers"] = {{{"byteLength", offset}}};
    document["bufferViews"] = views;
    document["accessors"] = accessors;
    return document;
  }

  void write_glb() {
    std::string json = gltf_document().dump();
    json.resize((json.size() + 3) / 4 * 4, ' ');
    const std::uint64_t data_bytes = gltf_bytes();
    const std::uint64_t bytes = 12 + 8 + json.size() + (data_bytes == 0 ? 0 : 8 + data_bytes);
    put(std::array{'g', 'l', 'T', 'F'}, std::uint32_t{2}, static_cast<std::uint32_t>(bytes));
    put(static_cast<std::uint32_t>(json.size()), std::array{'J', 'S', 'O', 'N'});
    pending_ += json;
    if (data_bytes != 0)
      put(static_cast<std::uint32_t>(data_bytes), std::array{'B', 'I', 'N', '\0'});
    flush();
    for_each(vertices_.size(), [&](std::size_t i) { put(local(i)); });
    write_all(normals_);
    write_all(triangles_);
  }

  /// Three bytes are four characters; all arrays are multiples of three bytes.
  template <class Value>
  void write_base64(std::size_t count, const Value &value_of) {
    constexpr std::string_view kDigits =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    constexpr std::size_t kBytes = sizeof(value_of(0));
    static_assert(kBytes % 3 == 0);
    for_each(count, [&](std::size_t i) {
      const auto value = value_of(i);
      std::array<unsigned char, kBytes> bytes{};
      std::memcpy(bytes.data(), &value, kBytes);
      for (std::size_t k = 0; k < kBytes; k += 3) {
        const unsigned bits = bytes[k] << 16 | bytes[k + 1] << 8 | bytes[k + 2];
        for (const unsigned shift : {18u, 12u, 6u, 0u}) pending_ += kDigits[bits >> shift & 63u];
      }
    });
  }

  void write_gltf() {
    // The data go where the document has this mark.
    constexpr std::string_view kMark = "@DATA@";
    nlohmann::ordered_json document = gltf_document();
    if (document.contains("buffers"))
      document["buffers"][0]["uri"] = fmt::format("data:application/octet-stream;base64,{}", kMark);
    const std::string text = document.dump(1) + "\n";
    const std::size_t mark = text.find(kMark);
    file_.write(std::string_view(text).substr(0, mark));
    if (mark == std::string::npos) return;
    write_base64(vertices_.size(), [this](std::size_t i) { return local(i); });
    write_base64(normals_.size(), [this](std::size_t i) { return normals_[i]; });
    write_base64(triangles_.size(), [this](std::size_t i) { return triangles_[i]; });
    file_.write(std::string_view(text).substr(mark + kMark.size()));
  }

  AtomicFile &file_;
  const std::filesystem::path &path_;
  const Progress &progress_;
  const bool is_float32_;
  const glm::dvec3 offset_;
  std::span<const glm::dvec3> vertices_;
  std::span<const glm::vec3> normals_;
  std::span<const Triangle> triangles_;
  std::string pending_;
  std::size_t done_ = 0, total_ = 0;
};

MeshFile::MeshFile(const std::filesystem::path &path)
    : path_(path),
      format_(mesh_format_of(path)),
      file_(path),
      vertices_(path),
      normals_(path),
      triangles_(path) {}

void MeshFile::add(const MeshPart &part) {
  for (const glm::dvec3 &vertex : part.vertices) {
    is_float32_ = is_float32_ && rounded_to_float32(vertex) == vertex;
    least_ = glm::min(least_, vertex);
    largest_ = glm::max(largest_, vertex);
  }
  vertices_.add(part.vertices);
  if (format_ != MeshFormat::kStl) normals_.add(part.normals);  // it has those of facets
  triangles_.add(part.triangles);
}

void MeshFile::commit(const Progress &progress) {
  Writer(*this, progress).write(format_);
  file_.commit();
}

glm::dvec3 MeshFile::offset() const {
  const bool has_float32_alone =
      format_ != MeshFormat::kPly && format_ != MeshFormat::kObj && format_ != MeshFormat::kVtp;
  if (is_float32_ || !has_float32_alone) return glm::dvec3(0);
  const auto largest_of = [](const glm::dvec3 &v) { return std::max({v.x, v.y, v.z}); };
  const glm::dvec3 sides = largest_ - least_, middle = 0.5 * least_ + 0.5 * largest_;
  const double side = largest_of(sides);
  constexpr double kFar = 8;  // sides; nearer, float32 would win fewer than 3 bits
  if (!(largest_of(glm::abs(middle)) > kFar * side && side > 0)) return glm::dvec3(0);
  // The middle of the mesh, in as few digits as bring it there.
  const double digits = -std::floor(std::log10(side)), scale = std::pow(10.0, std::abs(digits));
  return digits > 0 ? glm::round(middle * scale) / scale : glm::round(middle / scale) * scale;
}

std::string MeshFile::notice() const {
  if (format_ != MeshFormat::kStl || offset() == glm::dvec3(0)) return {};
  return fmt::format(
      "{}: STL has float32 positions, too coarse so far from the origin: add {}, as its header "
      "says",
      path_.string(), offset_text(offset()));
}

}  // namespace isowave::core
