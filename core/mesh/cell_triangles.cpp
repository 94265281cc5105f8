#include "core/mesh/cell_triangles.hpp"

#include <cstddef>
#include <limits>
#include <stdexcept>

namespace isowave::core {

namespace {

constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// The edge between two neighbouring corners.
std::uint32_t edge_between(std::uint32_t a, std::uint32_t b) {
  for (std::uint32_t edge = 0; edge < 12; ++edge) {
    const std::uint32_t lower = edge_corner(edge), upper = lower | 1u << edge_axis(edge);
    if ((a == lower && b == upper) || (a == upper && b == lower)) return edge;
  }
  throw std::logic_error("corners that are no neighbours");
}

using Face = std::array<std::uint32_t, 4>;

/// The corners of a face, counter-clockwise seen from outside the cell.
Face face_corners(std::uint32_t axis, bool upper) {
  const std::uint32_t u = 1u << (axis + 1) % 3, v = 1u << (axis + 2) % 3,
                      at = upper ? 1u << axis : 0u;
  return upper ? Face{at, at | u, at | u | v, at | v} : Face{at, at | v, at | u | v, at | u};
}

/// The edge from corner i of a face to the next.
std::uint32_t face_edge(const Face &face, std::size_t i) {
  return edge_between(face[i % 4], face[(i + 1) % 4]);
}

/// Enters the lines of a face: next[edge] is where a line goes that comes from there. Around the
/// face, each group of inside corners lies between two crossed edges.
void add_lines(const Face &face, std::uint32_t signs, std::array<std::uint32_t, 12> &next) {
  const auto is_inside = [&](std::size_t i) { return (signs >> face[i % 4] & 1u) != 0; };
  for (std::size_t i = 0; i < 4; ++i) {
    if (is_inside(i) || !is_inside(i + 1)) continue;
    std::size_t last = i + 1;
    while (is_inside(last + 1)) ++last;
    next[face_edge(face, i)] = face_edge(face, last);
  }
}

/// Whether some face has both edges.
bool share_face(std::uint32_t a, std::uint32_t b) {
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    const auto side = [axis](std::uint32_t edge) {
      return edge_axis(edge) == axis ? kNone : edge_corner(edge) >> axis & 1u;
    };
    if (side(a) != kNone && side(a) == side(b)) return true;
  }
  return false;
}

/// Cuts loop[first..last] into triangles with as few lines within faces as possible. Returns how
/// many there are; appends the edges of the triangles.
std::uint32_t cut(const std::vector<std::uint32_t> &loop, std::size_t first, std::size_t last,
                  std::vector<std::uint32_t> &triangles) {
  if (last - first < 2) return 0;
  std::uint32_t best = kNone;
  std::vector<std::uint32_t> chosen;
  const auto is_bad = [&](std::size_t a, std::size_t b) {
    return b - a > 1 && share_face(loop[a], loop[b]) ? 1u : 0u;
  };
  for (std::size_t middle = first + 1; middle < last; ++middle) {
    std::vector<std::uint32_t> tried = {loop[first], loop[middle], loop[last]};
    std::uint32_t bad = is_bad(first, middle) + is_bad(middle, last);
    bad += cut(loop, first, middle, tried);
    bad += cut(loop, middle, last, tried);
    if (bad < best) {
      best = bad;
      chosen = tried;
    }
  }
  triangles.insert(triangles.end(), chosen.begin(), chosen.end());
  return best;
}

CellTriangles make_cell_triangles() {
  CellTriangles table{};
  for (std::uint32_t signs = 0; signs < 256; ++signs) {
    std::vector<std::uint32_t> edges;
    for (const std::vector<std::uint32_t> &loop : cell_loops(signs))
      cut(loop, 0, loop.size() - 1, edges);
    if (edges.size() > 3 * std::size_t{ISO_CELL_TRIANGLES})
      throw std::logic_error("a cell of too many triangles");
    uchar *entry = &table.at(std::size_t{ISO_CASE_BYTES} * signs);
    entry[0] = static_cast<uchar>(edges.size() / 3);
    for (std::size_t i = 0; i < edges.size(); ++i) entry[1 + i] = static_cast<uchar>(edges[i]);
  }
  return table;
}

}  // namespace

std::vector<std::vector<std::uint32_t>> cell_loops(std::uint32_t signs) {
  std::array<std::uint32_t, 12> next{};
  next.fill(kNone);
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    add_lines(face_corners(axis, false), signs, next);
    add_lines(face_corners(axis, true), signs, next);
  }
  std::vector<std::vector<std::uint32_t>> loops;
  for (std::uint32_t begin = 0; begin < 12; ++begin) {
    if (next[begin] == kNone) continue;
    std::vector<std::uint32_t> &loop = loops.emplace_back();
    for (std::uint32_t edge = begin; next[edge] != kNone;) {
      loop.push_back(edge);
      const std::uint32_t behind = next[edge];
      next[edge] = kNone;
      edge = behind;
    }
  }
  return loops;
}

const CellTriangles &cell_triangles() {
  static const CellTriangles table = make_cell_triangles();
  return table;
}

}  // namespace isowave::core
