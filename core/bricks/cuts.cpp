#include "core/bricks/cuts.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "core/base/error.hpp"
#include "core/base/text.hpp"

namespace isowave::core {

namespace {

BlockBox part_below(BlockBox box, int axis, int plane) {
  box.end[axis] = plane;
  return box;
}

BlockBox part_above(BlockBox box, int axis, int plane) {
  box.begin[axis] = plane;
  return box;
}

/// Axes by the length of a box, the longest first; of the same length the last, so that rows and
/// layers of a file, or of a generator, stay whole.
std::array<int, 3> longest_first(const BlockBox &box) {
  std::array<int, 3> axes = {2, 1, 0};
  const glm::ivec3 size = box.end - box.begin;
  std::ranges::stable_sort(axes, [&](int a, int b) { return size[a] > size[b]; });
  return axes;
}

struct SharedCut {
  int axis = 0, plane = 0;
  double off = 0;  ///< of the work below that was wanted, as a part of it
};

/// The plane across an axis with the share of so many of `count` bricks below it, about.
SharedCut cut_across(int axis, const BlockBox &box, std::uint32_t count, std::uint64_t num_below,
                     const BoxWork &work) {
  const auto share = [&](int plane) {
    return static_cast<double>(work(part_below(box, axis, plane))) * count;
  };
  const double wanted = static_cast<double>(work(box)) * static_cast<double>(num_below);
  int low = box.begin[axis], high = box.end[axis];
  while (high - low > 1) {
    const int middle = low + (high - low) / 2;
    (share(middle) < wanted ? low : high) = middle;
  }
  const double too_few = wanted - share(low), too_many = share(high) - wanted;
  if (wanted == 0) return {axis, high, 0};
  return too_many < too_few ? SharedCut{axis, high, too_many / wanted}
                            : SharedCut{axis, low, too_few / wanted};
}

/// Across the longest side, unless that is off by more than a quarter and another less.
SharedCut best_cut(const BlockBox &box, std::uint32_t count, std::uint64_t num_below,
                   const BoxWork &work) {
  constexpr double kGoodEnough = 0.25;
  std::optional<SharedCut> best;
  for (const int axis : longest_first(box)) {
    if (box.end[axis] - box.begin[axis] < 2) continue;
    const SharedCut cut = cut_across(axis, box, count, num_below, work);
    if (!best || cut.off < best->off) best = cut;
    if (best->off <= kGoodEnough) break;
  }
  return *best;  // there is a side to cut, or there would be one brick
}

glm::ivec3 units_along(const glm::ivec3 &blocks, int unit) {
  return (blocks + (unit - 1)) / unit;
}

BlockBox scaled(const BlockBox &box, int unit, const glm::ivec3 &blocks) {
  return {box.begin * unit, glm::min(box.end * unit, blocks)};
}

std::string name_of_units(int unit) {
  return unit == 1 ? "blocks" : fmt::format("cubes of {}^3 blocks, for levels of detail,", unit);
}

}  // namespace

std::uint64_t num_blocks(const BlockBox &box) {
  const glm::u64vec3 size(box.end - box.begin);
  return size.x * size.y * size.z;
}

Cuts::Cuts(const glm::ivec3 &blocks, std::uint32_t count, const BoxWork &work, int unit) {
  const BlockBox all{glm::ivec3(0), units_along(blocks, unit)};
  if (count == 0 || count > num_blocks(all)) {
    throw Error("a volume of {} {} cannot be cut into {} bricks", num_blocks(all),
                name_of_units(unit), count);
  }
  root_ = cut(all, count, [&](const BlockBox &box) { return work(scaled(box, unit, blocks)); });
  scale(unit, blocks);
}

Cuts::Cuts(const glm::ivec3 &blocks, const glm::uvec3 &bricks, int unit) {
  const glm::ivec3 units = units_along(blocks, unit);
  for (int axis = 0; axis < 3; ++axis) {
    if (bricks[axis] == 0 || bricks[axis] > static_cast<std::uint32_t>(units[axis])) {
      throw Error("{}x{}x{} bricks cannot be cut from {}x{}x{} {}", bricks.x, bricks.y, bricks.z,
                  units.x, units.y, units.z, name_of_units(unit));
    }
  }
  bricks_.resize(std::size_t{bricks.x} * bricks.y * bricks.z);
  root_ = cut_grid({glm::ivec3(0), units}, glm::uvec3(0), bricks, bricks);
  scale(unit, blocks);
}

void Cuts::scale(int unit, const glm::ivec3 &blocks) {
  for (BlockBox &brick : bricks_) brick = scaled(brick, unit, blocks);
  for (Node &node : nodes_) node.plane *= unit;
}

std::uint32_t Cuts::add_brick(const BlockBox &box) {
  nodes_.push_back({.brick = static_cast<std::uint32_t>(bricks_.size())});
  bricks_.push_back(box);
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

std::uint32_t Cuts::cut(const BlockBox &box, std::uint32_t count, const BoxWork &work) {
  if (count == 1) return add_brick(box);
  std::uint64_t num_below = count / 2;
  const SharedCut found = best_cut(box, count, num_below, work);
  const int axis = found.axis, begin = box.begin[axis], end = box.end[axis];
  // Each brick needs a block.
  const std::uint64_t layer = num_blocks(box) / static_cast<std::uint64_t>(end - begin);
  const auto layers = [layer](std::uint64_t blocks) {
    return static_cast<int>((blocks + layer - 1) / layer);
  };
  int plane =
      std::min(std::max(found.plane, begin + layers(num_below)), end - layers(count - num_below));
  plane = std::clamp(plane, begin + 1, end - 1);
  const std::uint64_t room_below = layer * static_cast<std::uint64_t>(plane - begin),
                      room_above = layer * static_cast<std::uint64_t>(end - plane);
  num_below = std::min(num_below, room_below);
  if (count - num_below > room_above) num_below = count - room_above;
  const std::uint32_t first = cut(part_below(box, axis, plane), std::uint32_t(num_below), work),
                      second =
                          cut(part_above(box, axis, plane), std::uint32_t(count - num_below), work);
  nodes_.push_back({.axis = axis, .plane = plane, .below = first, .above = second});
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

std::uint32_t Cuts::cut_grid(const BlockBox &box, const glm::uvec3 &first, const glm::uvec3 &bricks,
                             const glm::uvec3 &all) {
  const int axis = longest_first({glm::ivec3(0), glm::ivec3(bricks)}).front();
  const std::uint32_t half = bricks[axis] / 2;
  if (half == 0) {
    const std::size_t brick =
        first.x + std::size_t{all.x} * (first.y + std::size_t{all.y} * first.z);
    bricks_[brick] = box;
    nodes_.push_back({.brick = static_cast<std::uint32_t>(brick)});
    return static_cast<std::uint32_t>(nodes_.size() - 1);
  }
  const int side = box.end[axis] - box.begin[axis];
  const int plane = box.begin[axis] + static_cast<int>(std::int64_t{side} * half / bricks[axis]);
  glm::uvec3 num_below = bricks, num_above = bricks, behind = first;
  num_below[axis] = half;
  num_above[axis] -= half;
  behind[axis] += half;
  const std::uint32_t low = cut_grid(part_below(box, axis, plane), first, num_below, all),
                      high = cut_grid(part_above(box, axis, plane), behind, num_above, all);
  nodes_.push_back({.axis = axis, .plane = plane, .below = low, .above = high});
  return static_cast<std::uint32_t>(nodes_.size() - 1);
}

std::vector<std::uint32_t> Cuts::order_from(const glm::vec3 &eye) const {
  std::vector<std::uint32_t> places(bricks_.size());
  std::uint32_t place = 0;
  visit(root_, eye, place, places);
  return places;
}

/// A ray crosses a plane at most once, towards the side where the eye is not. From an eye in the
/// plane it never does: it begins on one side and stays there.
void Cuts::visit(std::uint32_t node, const glm::vec3 &eye, std::uint32_t &place,
                 std::vector<std::uint32_t> &places) const {
  const Node &at = nodes_[node];
  if (at.axis < 0) {
    places[at.brick] = place++;
    return;
  }
  const bool is_above = eye[at.axis] >= 4.0f * static_cast<float>(at.plane);
  visit(is_above ? at.above : at.below, eye, place, places);
  visit(is_above ? at.below : at.above, eye, place, places);
}

glm::uvec3 parse_bricks(std::string_view text) {
  std::array<std::uint32_t, 3> bricks{};
  std::string_view rest = text;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const std::size_t end = axis < 2 ? rest.find('x') : rest.size();
    const auto number = end == std::string_view::npos
                            ? std::nullopt
                            : parse_all<std::uint32_t>(rest.substr(0, end));
    if (!number || *number == 0 || *number > 1u << 16)
      throw Error("bricks {}: write XxYxZ, how many along each axis", text);
    bricks[axis] = *number;
    rest.remove_prefix(axis < 2 ? end + 1 : end);
  }
  return {bricks[0], bricks[1], bricks[2]};
}

}  // namespace isowave::core
