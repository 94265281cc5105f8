// core/mesh/cell_triangles: every table entry is closed over its faces, agrees with its
// neighbours', and separates what the rule says.

#include "core/mesh/cell_triangles.hpp"

#include <gtest/gtest.h>

#include <array>
#include <map>
#include <set>
#include <utility>
#include <vector>

namespace isowave::core {
namespace {

using Line = std::pair<std::uint32_t, std::uint32_t>;  // from an edge to an edge

std::array<std::uint32_t, 2> corners_of_edge(std::uint32_t edge) {
  const std::uint32_t lower = edge_corner(edge);
  return {lower, lower | 1u << edge_axis(edge)};
}

std::vector<std::array<std::uint32_t, 3>> triangles_of(std::uint32_t signs) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  const uchar *entry = &cell_triangles().at(16 * std::size_t{signs});
  for (std::uint32_t i = 0; i < entry[0]; ++i)
    triangles.push_back({entry[1 + 3 * i], entry[2 + 3 * i], entry[3 + 3 * i]});
  return triangles;
}

/// Lines of which the opposite one is in no triangle: the border of the surface in the cell.
std::set<Line> border_of(std::uint32_t signs) {
  std::multiset<Line> all;
  for (const auto &triangle : triangles_of(signs)) {
    for (std::size_t i = 0; i < 3; ++i) all.emplace(triangle[i], triangle[(i + 1) % 3]);
  }
  std::set<Line> border;
  for (const Line &line : all) {
    EXPECT_EQ(all.count(line), 1u) << "signs " << signs << ": two triangles on one side of a line";
    if (all.count({line.second, line.first}) == 0) border.insert(line);
  }
  return border;
}

/// Which faces (axis + 3 * side) an edge lies in, as a mask.
std::uint32_t faces_of(std::uint32_t edge) {
  const auto [a, b] = corners_of_edge(edge);
  std::uint32_t faces = 0;
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    if ((a >> axis & 1) == (b >> axis & 1)) faces |= 1u << (axis + 3 * (a >> axis & 1));
  }
  return faces;
}

TEST(CellTriangles, EdgesAreTheTwelveOfACell) {
  std::set<std::array<std::uint32_t, 2>> all;
  for (std::uint32_t edge = 0; edge < 12; ++edge) {
    const auto [a, b] = corners_of_edge(edge);
    EXPECT_EQ(a & 1u << edge_axis(edge), 0u);
    all.insert({a, b});
  }
  EXPECT_EQ(all.size(), 12u);
}

TEST(CellTriangles, VerticesAreOnTheCrossedEdgesAndAllOfThem) {
  for (std::uint32_t signs = 0; signs < 256; ++signs) {
    std::set<std::uint32_t> used, crossed;
    for (const auto &triangle : triangles_of(signs)) used.insert(triangle.begin(), triangle.end());
    for (std::uint32_t edge = 0; edge < 12; ++edge) {
      const auto [a, b] = corners_of_edge(edge);
      if ((signs >> a & 1) != (signs >> b & 1)) crossed.insert(edge);
    }
    EXPECT_EQ(used, crossed) << "signs " << signs;
  }
}

/// Inner lines have two triangles; the others lie in faces, as many as these are crossed.
TEST(CellTriangles, EveryCaseIsClosedOverItsFaces) {
  for (std::uint32_t signs = 0; signs < 256; ++signs) {
    std::map<std::uint32_t, int> going, coming;
    for (const auto &[from, to] : border_of(signs)) {
      EXPECT_NE(faces_of(from) & faces_of(to), 0u) << "signs " << signs << ": a line in no face";
      ++going[from];
      ++coming[to];
    }
    for (std::uint32_t edge = 0; edge < 12; ++edge) {
      const auto [a, b] = corners_of_edge(edge);
      const int expected = (signs >> a & 1) != (signs >> b & 1) ? 1 : 0;
      EXPECT_EQ(going[edge], expected) << "signs " << signs << ", edge " << edge;
      EXPECT_EQ(coming[edge], expected) << "signs " << signs << ", edge " << edge;
    }
  }
}

/// No line within a cell lies in a face, or a neighbour could have the same one.
TEST(CellTriangles, NoInnerLineLiesInAFace) {
  for (std::uint32_t signs = 0; signs < 256; ++signs) {
    const std::set<Line> border = border_of(signs);
    for (const auto &triangle : triangles_of(signs)) {
      for (std::size_t i = 0; i < 3; ++i) {
        const Line line(triangle[i], triangle[(i + 1) % 3]);
        if (border.count(line) != 0) continue;
        EXPECT_EQ(faces_of(line.first) & faces_of(line.second), 0u) << "signs " << signs;
      }
    }
  }
}

/// The lines of a case in one face.
std::set<Line> lines_in(std::uint32_t signs, std::uint32_t face) {
  std::set<Line> lines;
  for (const auto &[from, to] : border_of(signs)) {
    if ((faces_of(from) & faces_of(to) & 1u << face) != 0) lines.emplace(from, to);
  }
  return lines;
}

/// An edge of the face at the upper end of an axis as one of the neighbour's lower face.
std::uint32_t moved(std::uint32_t edge, std::uint32_t axis) {
  const auto [a, b] = corners_of_edge(edge);
  for (std::uint32_t other = 0; other < 12; ++other) {
    if (corners_of_edge(other) == std::array{a ^ 1u << axis, b ^ 1u << axis}) return other;
  }
  return 12;
}

TEST(CellTriangles, NeighboursHaveTheSameLinesTheOtherWayRound) {
  for (std::uint32_t axis = 0; axis < 3; ++axis) {
    for (std::uint32_t signs = 0; signs < 256; ++signs) {
      for (std::uint32_t beyond = 0; beyond < 16; ++beyond) {
        std::uint32_t neighbour = 0;
        for (std::uint32_t corner = 0, i = 0; corner < 8; ++corner) {
          const bool is_shared = (corner >> axis & 1) == 0;
          const std::uint32_t bit =
              is_shared ? signs >> (corner | 1u << axis) & 1 : beyond >> i++ & 1;
          neighbour |= bit << corner;
        }
        std::set<Line> expected;
        for (const auto &[from, to] : lines_in(signs, axis + 3))
          expected.emplace(moved(to, axis), moved(from, axis));
        ASSERT_EQ(lines_in(neighbour, axis), expected)
            << "axis " << axis << ", signs " << signs << " and " << neighbour;
      }
    }
  }
}

TEST(CellTriangles, NormalsPointAwayFromInside) {
  // Corner 0 inside: the triangle cuts it off, and is seen counter-clockwise from corner 7.
  const auto triangles = triangles_of(1);
  ASSERT_EQ(triangles.size(), 1u);
  std::array<std::array<int, 3>, 3> points{};
  for (std::size_t i = 0; i < 3; ++i) points[i].at(edge_axis(triangles[0][i])) = 1;
  const auto difference = [&](std::size_t i, std::size_t axis) {
    return points[i].at(axis) - points[0].at(axis);
  };
  const int normal_x = difference(1, 1) * difference(2, 2) - difference(1, 2) * difference(2, 1);
  EXPECT_EQ(normal_x, 1);
}

/// As VTK's tables: two inside corners across a face are two pieces, two outside ones are none.
TEST(CellTriangles, InsideCornersAcrossAFaceAreSeparated) {
  EXPECT_EQ(cell_loops(0b00001001).size(), 2u);  // corners 0 and 3 inside
  EXPECT_EQ(cell_loops(0b11110110).size(), 1u);  // corners 0 and 3 outside
  EXPECT_EQ(triangles_of(0b00001001).size(), 2u);
  EXPECT_EQ(triangles_of(0b11110110).size(), 4u);
}

}  // namespace
}  // namespace isowave::core
