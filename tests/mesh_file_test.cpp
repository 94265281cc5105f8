// core/mesh/mesh_file: the files that are written, taken apart by the rules of their formats.

#include "core/mesh/mesh_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>

#include "core/base/error.hpp"
#include "tests/mesh_checks.hpp"
#include "tests/run_program.hpp"

namespace isowave::core {
namespace {

using test::read_file;
using testing::HasSubstr;
using testing::StartsWith;
using testing::ThrowsMessage;

/// Positions as a file of float32 has them.
std::vector<glm::vec3> to_float32(const std::vector<glm::dvec3> &positions) {
  return {positions.begin(), positions.end()};
}

/// A tetrahedron, given in two parts; the first names vertices of the second.
Mesh tetrahedron(bool with_normals) {
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {1.5, 0, 0}, {0, 2, 0}, {double{0.1f}, 0, double{3e-7f}}};
  if (with_normals) mesh.normals = {{-1, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  mesh.triangles = {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {0, 3, 2}};
  return mesh;
}

class MeshFiles : public testing::Test {
 protected:
  std::string write(const char *name, const Mesh &mesh) {
    const std::filesystem::path path = folder_ / name;
    std::filesystem::remove(path);
    MeshFile file(path);
    file.begin({mesh.vertices.size(), mesh.triangles.size(), !mesh.normals.empty()});
    const std::size_t half = mesh.vertices.size() / 2;
    const std::span<const glm::dvec3> vertices = mesh.vertices;
    const std::span<const glm::vec3> normals = mesh.normals;
    const std::span<const Triangle> triangles = mesh.triangles;
    file.add({vertices.first(half), normals.first(normals.empty() ? 0 : half), triangles});
    file.add({vertices.subspan(half), normals.subspan(normals.empty() ? 0 : half), {}});
    EXPECT_FALSE(std::filesystem::exists(path)) << "half-written";
    file.commit();
    offset_ = file.offset();
    notice_ = file.notice();
    return read_file(path);
  }

  /// Takes a T from the front.
  template <class T>
  static T take(std::string_view &bytes) {
    T value;
    EXPECT_GE(bytes.size(), sizeof(T));
    std::memcpy(&value, bytes.data(), sizeof(T));
    bytes.remove_prefix(sizeof(T));
    return value;
  }
  template <class T>
  static std::vector<T> take_all(std::string_view &bytes, std::size_t count) {
    std::vector<T> values;
    for (std::size_t i = 0; i < count; ++i) values.push_back(take<T>(bytes));
    return values;
  }

  test::TemporaryFolder folder_;
  glm::dvec3 offset_{0};  ///< of the file that was written last
  std::string notice_;
};

TEST_F(MeshFiles, Ply) {
  for (const bool with_normals : {false, true}) {
    const Mesh mesh = tetrahedron(with_normals);
    const std::string file = write("a.ply", mesh);
    EXPECT_THAT(file, StartsWith("ply\nformat binary_little_endian 1.0\n"));
    EXPECT_THAT(file, HasSubstr("element vertex 4\nproperty float x\n"));
    EXPECT_EQ(file.find("property float nx") != std::string::npos, with_normals);
    EXPECT_THAT(file, HasSubstr("element face 4\nproperty list uchar int vertex_indices\n"));
    std::string_view rest = file;
    rest.remove_prefix(file.find("end_header\n") + 11);
    for (std::size_t i = 0; i < 4; ++i) {
      EXPECT_EQ(take<glm::vec3>(rest), glm::vec3(mesh.vertices[i]));
      if (with_normals) {
        EXPECT_EQ(take<glm::vec3>(rest), mesh.normals[i]);
      }
    }
    for (const Triangle &triangle : mesh.triangles) {
      EXPECT_EQ(take<std::uint8_t>(rest), 3);
      EXPECT_EQ(take<Triangle>(rest), triangle);
    }
    EXPECT_EQ(rest.size(), 0u);
  }
}

TEST_F(MeshFiles, Stl) {
  const Mesh mesh = tetrahedron(true);
  const std::string file = write("a.STL", mesh);
  EXPECT_NE(file.substr(0, 5), "solid") << "readers would take it for text";
  std::string_view rest = file;
  rest.remove_prefix(80);
  EXPECT_EQ(take<std::uint32_t>(rest), 4u);
  for (const Triangle &triangle : mesh.triangles) {
    const auto normal = take<glm::vec3>(rest);
    const auto corners = take_all<glm::vec3>(rest, 3);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(corners[i], glm::vec3(mesh.vertices[triangle[i]]));
    EXPECT_NEAR(glm::length(normal), 1, 1e-6);
    EXPECT_NEAR(glm::dot(normal, corners[1] - corners[0]), 0, 1e-6);
    EXPECT_NEAR(glm::dot(normal, corners[2] - corners[0]), 0, 1e-6);
    EXPECT_EQ(take<std::uint16_t>(rest), 0);
  }
  EXPECT_EQ(rest.size(), 0u);
}

TEST_F(MeshFiles, Obj) {
  for (const bool with_normals : {false, true}) {
    const Mesh mesh = tetrahedron(with_normals);
    std::istringstream file(write("a.obj", mesh));
    Mesh got;
    for (std::string line; std::getline(file, line);) {
      std::istringstream words(line);
      std::string kind;
      words >> kind;
      if (kind == "v" || kind == "vn") {
        glm::vec3 v;
        words >> v.x >> v.y >> v.z;
        if (kind == "v")
          got.vertices.emplace_back(v);
        else
          got.normals.push_back(v);
      } else if (kind == "f") {
        Triangle &triangle = got.triangles.emplace_back();
        for (std::uint32_t &vertex : triangle) {
          std::string number;
          words >> number;
          vertex = static_cast<std::uint32_t>(std::stoul(number)) - 1;
          EXPECT_EQ(number, with_normals ? fmt::format("{0}//{0}", vertex + 1)
                                         : std::to_string(vertex + 1));
        }
      }
    }
    expect_same_mesh(got, mesh);
  }
}

TEST_F(MeshFiles, Vtp) {
  for (const bool with_normals : {false, true}) {
    const Mesh mesh = tetrahedron(with_normals);
    const std::string file = write("a.vtp", mesh);
    EXPECT_THAT(file, HasSubstr("NumberOfPoints=\"4\""));
    EXPECT_THAT(file, HasSubstr("NumberOfPolys=\"4\""));
    const std::size_t begin = file.find("encoding=\"raw\">\n_") + 17;
    /// The array whose description has such a text, where its offset says.
    const auto array_at = [&](const std::string &text, std::size_t bytes) {
      const std::size_t at = file.find("offset=\"", file.find(text)) + 8;
      std::string_view rest = file;
      rest.remove_prefix(begin + std::stoul(file.substr(at)));
      EXPECT_EQ(take<std::uint64_t>(rest), bytes) << text;
      return rest;
    };
    std::string_view points = array_at("Name=\"Points\"", 48);
    EXPECT_EQ(take_all<glm::vec3>(points, 4), to_float32(mesh.vertices));
    if (with_normals) {
      std::string_view normals = array_at("Name=\"Normals\"", 48);
      EXPECT_EQ(take_all<glm::vec3>(normals, 4), mesh.normals);
    }
    std::string_view connectivity = array_at("Name=\"connectivity\"", 48);
    EXPECT_EQ(take_all<Triangle>(connectivity, 4), mesh.triangles);
    std::string_view offsets = array_at("Name=\"offsets\"", 16);
    EXPECT_EQ(take_all<std::int32_t>(offsets, 4), (std::vector<std::int32_t>{3, 6, 9, 12}));
    EXPECT_EQ(offsets, "\n</AppendedData>\n</VTKFile>\n");
  }
}

/// Both forms of glTF have one document and the same data.
void expect_gltf(const nlohmann::json &document, std::string_view data, const Mesh &mesh) {
  EXPECT_EQ(document["asset"]["version"], "2.0");
  const nlohmann::json &primitive = document["meshes"][0]["primitives"][0];
  const auto bytes_of = [&](const nlohmann::json &accessor_id, std::size_t count) {
    const nlohmann::json &accessor = document["accessors"][accessor_id.get<std::size_t>()];
    const nlohmann::json &view = document["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    EXPECT_EQ(accessor["count"], count);
    return data.substr(view["byteOffset"], view["byteLength"]);
  };
  const auto holds = [](std::string_view bytes, const auto &values) {
    return bytes == std::string_view(reinterpret_cast<const char *>(values.data()),
                                     values.size() * sizeof(values[0]));
  };
  EXPECT_TRUE(holds(bytes_of(primitive["attributes"]["POSITION"], 4), to_float32(mesh.vertices)));
  EXPECT_FALSE(document["nodes"][0].contains("translation"));
  EXPECT_EQ(primitive["attributes"].contains("NORMAL"), !mesh.normals.empty());
  if (!mesh.normals.empty()) {
    EXPECT_TRUE(holds(bytes_of(primitive["attributes"]["NORMAL"], 4), mesh.normals));
  }
  EXPECT_TRUE(holds(bytes_of(primitive["indices"], 12), mesh.triangles));
  EXPECT_EQ(document["buffers"][0]["byteLength"], data.size());
  EXPECT_EQ(document["accessors"][0]["max"], (nlohmann::json{1.5f, 2.0f, 3e-7f}));
}

TEST_F(MeshFiles, Glb) {
  for (const bool with_normals : {false, true}) {
    const std::string file = write("a.glb", tetrahedron(with_normals));
    std::string_view rest = file;
    EXPECT_EQ(take<std::uint32_t>(rest), 0x46546C67u);
    EXPECT_EQ(take<std::uint32_t>(rest), 2u);
    EXPECT_EQ(take<std::uint32_t>(rest), file.size());
    const auto json_bytes = take<std::uint32_t>(rest);
    EXPECT_EQ(take<std::uint32_t>(rest), 0x4E4F534Au);
    const auto document = nlohmann::json::parse(rest.substr(0, json_bytes));
    rest.remove_prefix(json_bytes);
    const auto data_bytes = take<std::uint32_t>(rest);
    EXPECT_EQ(take<std::uint32_t>(rest), 0x004E4942u);
    EXPECT_EQ(rest.size(), data_bytes);
    expect_gltf(document, rest, tetrahedron(with_normals));
  }
}

TEST_F(MeshFiles, Gltf) {
  const auto document = nlohmann::json::parse(write("a.gltf", tetrahedron(true)));
  const std::string uri = document["buffers"][0]["uri"];
  constexpr std::string_view kHead = "data:application/octet-stream;base64,";
  ASSERT_THAT(uri, StartsWith(std::string(kHead)));
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string data;
  for (std::size_t i = kHead.size(); i < uri.size(); i += 4) {
    std::size_t bits = 0;
    for (std::size_t k = 0; k < 4; ++k) bits = bits << 6 | digits.find(uri[i + k]);
    for (const int shift : {16, 8, 0}) data += static_cast<char>(bits >> shift & 255);
  }
  expect_gltf(document, data, tetrahedron(true));
}

/// As the coordinates of maps: float32 has steps of 1/2 there, the mesh has sides of 1.
Mesh far_mesh() {
  Mesh mesh = tetrahedron(false);
  for (glm::dvec3 &vertex : mesh.vertices) vertex += glm::dvec3(4500000.3, 6700000.7, 120.45);
  return mesh;
}

TEST_F(MeshFiles, FarFromTheOriginPositionsKeepTheirBits) {
  const Mesh mesh = far_mesh();
  const std::string ply = write("a.ply", mesh);
  EXPECT_THAT(ply, HasSubstr("property double x\nproperty double y\nproperty double z\n"));
  std::string_view rest = ply;
  rest.remove_prefix(ply.find("end_header\n") + 11);
  EXPECT_EQ(take_all<glm::dvec3>(rest, 4), mesh.vertices);
  EXPECT_EQ(rest.size(), 4 * 13u);

  std::istringstream obj(write("a.obj", mesh));
  std::vector<glm::dvec3> of_obj;
  for (std::string line; std::getline(obj, line);) {
    std::istringstream words(line);
    glm::dvec3 v;
    if (words.get() == 'v' && words >> v.x >> v.y >> v.z) of_obj.push_back(v);
  }
  EXPECT_EQ(of_obj, mesh.vertices);

  const std::string vtp = write("a.vtp", mesh);
  EXPECT_THAT(vtp, HasSubstr("<DataArray type=\"Float64\" Name=\"Points\""));
  rest = vtp;
  rest.remove_prefix(vtp.find("encoding=\"raw\">\n_") + 17);
  EXPECT_EQ(take<std::uint64_t>(rest), 96u);
  EXPECT_EQ(take_all<glm::dvec3>(rest, 4), mesh.vertices);
  EXPECT_EQ(take<std::uint64_t>(rest), 48u) << "connectivity";
  EXPECT_EQ(offset_, glm::dvec3(0));
  EXPECT_EQ(notice_, "");
}

TEST_F(MeshFiles, FarFromTheOriginFormatsOfFloat32HaveAnOffset) {
  const Mesh mesh = far_mesh();
  const std::string stl = write("a.stl", mesh);
  EXPECT_EQ(offset_, glm::dvec3(4500001, 6700002, 120));
  EXPECT_STREQ(stl.substr(0, 80).c_str(), "isowave STL, add 4500001 6700002 120 to x y z");
  EXPECT_THAT(notice_, HasSubstr("add 4500001 6700002 120 to x y z"));
  std::string_view rest = stl;
  rest.remove_prefix(84);
  for (const Triangle &triangle : mesh.triangles) {
    take<glm::vec3>(rest);
    const auto corners = take_all<glm::vec3>(rest, 3);
    for (std::size_t i = 0; i < 3; ++i)
      EXPECT_EQ(corners[i], glm::vec3(mesh.vertices[triangle[i]] - offset_));
    take<std::uint16_t>(rest);
  }
  for (const char *name : {"a.gltf", "a.glb"}) {
    const std::string file = write(name, mesh);
    const std::size_t begin = file.find('{');
    const auto document = nlohmann::json::parse(
        name == std::string("a.gltf")
            ? file
            : file.substr(begin, file.rfind('}', file.find("BIN")) + 1 - begin));
    EXPECT_EQ(document["nodes"][0]["translation"], (nlohmann::json{4500001.0, 6700002.0, 120.0}));
    EXPECT_EQ(document["accessors"][0]["max"][0], glm::vec3(mesh.vertices[1] - offset_).x) << name;
    EXPECT_EQ(notice_, "") << "readers of glTF know of nodes";
  }
}

TEST_F(MeshFiles, AnEmptyMeshIsAFileToo) {
  for (const char *name : {"e.ply", "e.stl", "e.obj", "e.vtp", "e.gltf", "e.glb"})
    EXPECT_GT(write(name, Mesh()).size(), 10u) << name;
  EXPECT_FALSE(nlohmann::json::parse(read_file(folder_ / "e.gltf")).contains("meshes"))
      << "glTF knows no empty accessors";
}

TEST_F(MeshFiles, NothingIsLeftBehind) {
  {
    MeshFile file(folder_ / "a.ply");
    file.add({tetrahedron(false).vertices, {}, {}});
  }
  EXPECT_TRUE(std::filesystem::is_empty(folder_.path()));
}

TEST_F(MeshFiles, RefusesOtherNames) {
  for (const char *name : {"a", "a.off", ".ply", "ply", "a.ply.gz"})
    EXPECT_THAT([&] { mesh_format_of(name); }, ThrowsMessage<Error>(HasSubstr("end the name in")));
  EXPECT_THAT([&] { MeshFile(folder_ / "none" / "a.ply"); },
              ThrowsMessage<Error>(HasSubstr("cannot write")));
}

}  // namespace
}  // namespace isowave::core
