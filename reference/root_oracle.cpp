#include "reference/root_oracle.hpp"

#include <gmpxx.h>

#include <algorithm>
#include <boost/numeric/interval.hpp>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

namespace isowave::core {

namespace {

/// Its operations need a RoundsUp that lives: to set the rounding for each would take most of the
/// time.
using Interval = boost::numeric::interval_lib::unprotect<boost::numeric::interval<double>>::type;
using RoundsUp = boost::numeric::interval<double>::traits_type::rounding;

/// t at which the ray crosses a grid plane of one axis: (plane - origin) / direction, of exact
/// numbers.
struct Crossing {
  double plane = 0, origin = 0, direction = 1;
  double t = kInfinity;  ///< rounded
  int axis = 3;          ///< 3: the start of the ray, whose t is `plane`

  mpq_class exact() const { return (mpq_class(plane) - mpq_class(origin)) / mpq_class(direction); }
  Interval interval() const { return (Interval(plane) - Interval(origin)) / Interval(direction); }
};

/// Exact order of two crossings: < 0, 0, > 0.
int compare(const Crossing &a, const Crossing &b) {
  if (a.t == kInfinity || b.t == kInfinity) return (a.t > b.t) - (a.t < b.t);
  if (std::abs(a.t - b.t) > 1e-14 * std::max(std::abs(a.t), std::abs(b.t)))
    return a.t < b.t ? -1 : 1;
  return cmp(a.exact(), b.exact());
}

/// A cubic a0 + a1 s + a2 s^2 + a3 s^3 of some number type.
template <class Number>
using Polynomial = std::array<Number, 4>;

/// The field on the segment from p (s = 0) to p + e (s = 1), minus the isovalue: the multilinear
/// expansion sum over subsets of axes of (mixed difference) * product of coordinates, multiplied
/// out in s.
template <class Number>
Polynomial<Number> along_segment(const std::array<double, 8> &v, double isovalue,
                                 const std::array<Number, 3> &p, const std::array<Number, 3> &e) {
  Polynomial<Number> sum{Number(0.0), Number(0.0), Number(0.0), Number(0.0)};
  std::array<Number, 8> difference{Number(v[0]), Number(v[1]), Number(v[2]), Number(v[3]),
                                   Number(v[4]), Number(v[5]), Number(v[6]), Number(v[7])};
  for (unsigned axis = 0; axis < 3; ++axis) {  // in place: corner values -> mixed differences
    for (unsigned corner = 0; corner < 8; ++corner) {
      if (corner >> axis & 1u)
        difference[corner] = difference[corner] - difference[corner ^ (1u << axis)];
    }
  }
  for (unsigned subset = 0; subset < 8; ++subset) {
    Polynomial<Number> product{difference[subset], Number(0.0), Number(0.0), Number(0.0)};
    for (unsigned axis = 0; axis < 3; ++axis) {
      if (!(subset >> axis & 1u)) continue;
      for (unsigned power = 3; power > 0; --power) {
        product[power] = product[power] * p[axis] + product[power - 1] * e[axis];
      }
      product[0] = product[0] * p[axis];
    }
    for (unsigned power = 0; power < 4; ++power) sum[power] = sum[power] + product[power];
  }
  sum[0] = sum[0] - Number(isovalue);
  return sum;
}

/// Coefficients in the Bernstein basis on [0,1]: b_k = sum over j <= k of C(k,j) / C(3,j) a_j.
template <class Number>
Polynomial<Number> bernstein(const Polynomial<Number> &a) {
  const Number one_third = Number(1.0) / Number(3.0), two_thirds = Number(2.0) / Number(3.0);
  return {a[0], a[0] + a[1] * one_third, a[0] + a[1] * two_thirds + a[2] * one_third,
          a[0] + a[1] + a[2] + a[3]};
}

/// Halves of a cubic in Bernstein form.
template <class Number>
std::array<Polynomial<Number>, 2> halves(const Polynomial<Number> &b) {
  const Number half(0.5);
  const Number c0 = (b[0] + b[1]) * half, c1 = (b[1] + b[2]) * half, c2 = (b[2] + b[3]) * half;
  const Number d0 = (c0 + c1) * half, d1 = (c1 + c2) * half;
  const Number e = (d0 + d1) * half;
  return {Polynomial<Number>{b[0], c0, d0, e}, Polynomial<Number>{e, d1, c2, b[3]}};
}

enum class Side { kOutside, kInside, kUnknown };

Side side(const Interval &x) {
  if (x.lower() >= 0) return Side::kInside;
  return x.upper() < 0 ? Side::kOutside : Side::kUnknown;
}

Side side(const mpq_class &x) {
  return x >= 0 ? Side::kInside : Side::kOutside;
}

/// A change of inside at s of the segment: from outside to inside, or back.
struct Change {
  double s;
  bool enters;
};
/// Changes of a segment, in their order; as many as are wanted.
struct Changes {
  std::size_t most;
  std::vector<Change> found{};
  bool are_enough() const { return found.size() >= most; }
};

/// The number of distinct real roots in (0,1], by Sturm's chain, for what subdivision cannot end:
/// multiple roots.
int count_distinct_roots(const Polynomial<mpq_class> &b) {
  using Poly = std::vector<mpq_class>;
  const auto trim = [](Poly &p) {
    while (!p.empty() && p.back() == 0) p.pop_back();
  };
  const auto value = [](const Poly &p, const mpq_class &x) {
    mpq_class sum = 0;
    for (std::size_t i = p.size(); i-- > 0;) sum = sum * x + p[i];
    return sum;
  };
  Poly p{b[0], 3 * (b[1] - b[0]), 3 * (b[2] - 2 * b[1] + b[0]), b[3] - 3 * b[2] + 3 * b[1] - b[0]};
  trim(p);
  Poly q;
  for (std::size_t i = 1; i < p.size(); ++i) q.push_back(p[i] * static_cast<double>(i));
  trim(q);
  std::vector<Poly> chain{p};
  while (!q.empty()) {
    chain.push_back(q);
    Poly r = chain[chain.size() - 2];
    while (r.size() >= q.size() && !r.empty()) {  // polynomial remainder
      const mpq_class factor = r.back() / q.back();
      const std::size_t shift = r.size() - q.size();
      for (std::size_t i = 0; i < q.size(); ++i) r[i + shift] -= factor * q[i];
      trim(r);
    }
    for (mpq_class &c : r) c = -c;
    q = r;
  }
  const auto variations = [&](const mpq_class &x) {
    int count = 0, last = 0;
    for (const Poly &member : chain) {
      const int sign = sgn(value(member, x));
      if (sign != 0 && last != 0 && sign != last) ++count;
      if (sign != 0) last = sign;
    }
    return count;
  };
  return variations(0) - variations(1);
}

double middle(const Interval &x) {
  return boost::numeric::median(x);
}

double middle(const mpq_class &x) {
  return x.get_d();
}

/// The place in [0,1] where a cubic with one sign variation changes sign, to double precision.
template <class Number>
double place_of_root(const Polynomial<Number> &b) {
  const std::array<double, 4> c{middle(b[0]), middle(b[1]), middle(b[2]), middle(b[3])};
  double low = 0, high = 1;
  for (int i = 0; i < std::numeric_limits<double>::digits; ++i) {
    const double s = 0.5 * (low + high), r = 1 - s;
    const double value = r * r * r * c[0] + 3 * r * s * (r * c[1] + s * c[2]) + s * s * s * c[3];
    ((value >= 0) == (c[0] >= 0) ? low : high) = s;
  }
  return high;  // where inside has changed
}

/// A piece so small that its roots are one point for every purpose but their number.
constexpr int kMaxDepth = 56;
/// Interval arithmetic gives up earlier: its bounds no longer shrink.
constexpr int kMaxIntervalDepth = 30;

bool append_from_small_piece(const Polynomial<Interval> &, double, Changes &) {
  return false;
}

/// One change if inside at the ends differs, else two near roots, one double root, or none.
bool append_from_small_piece(const Polynomial<mpq_class> &b, double s, Changes &changes) {
  const bool starts_outside = side(b[0]) == Side::kOutside;
  int count = 1;
  if (side(b[0]) == side(b[3])) {
    const bool ends_on_zero = b[0] == 0 || b[3] == 0;
    const int roots = count_distinct_roots(b);
    // Touching the isovalue from outside is already inside.
    count = (starts_outside ? roots > 0 : roots - (ends_on_zero ? 1 : 0) > 1) ? 2 : 0;
  }
  for (int i = 0; i < count; ++i)
    if (!changes.are_enough()) changes.found.push_back({s, starts_outside == (i == 0)});
  return true;
}

/// Appends the changes of inside on the piece [begin, begin + width] of [0,1], leftmost first,
/// until they are enough. Returns false if the number type cannot tell what comes next.
template <class Number>
bool append_changes(const Polynomial<Number> &b, double begin, double width, int depth,
                    int max_depth, Changes &changes) {
  std::array<Side, 4> sides;
  for (unsigned i = 0; i < 4; ++i) sides[i] = side(b[i]);
  if (sides[0] == Side::kUnknown) return false;
  const bool known = std::find(sides.begin(), sides.end(), Side::kUnknown) == sides.end();
  int variations = 0;
  for (unsigned i = 1; i < 4; ++i) variations += sides[i] != sides[i - 1];
  if (known && variations == 0) return true;  // the curve lies in the hull of its coefficients
  if (known && variations == 1) {             // Descartes
    changes.found.push_back({begin + width * place_of_root(b), sides[0] == Side::kOutside});
    return true;
  }
  if (depth >= max_depth) return append_from_small_piece(b, begin + 0.5 * width, changes);
  const auto [left, right] = halves(b);
  if (!append_changes(left, begin, 0.5 * width, depth + 1, max_depth, changes)) return false;
  return changes.are_enough() ||
         append_changes(right, begin + 0.5 * width, 0.5 * width, depth + 1, max_depth, changes);
}

/// Position of the ray at a crossing, relative to the cell's origin, as an interval or exactly.
template <class Number>
std::array<Number, 3> position(const OracleRay &ray, const std::array<int, 3> &cell,
                               const Number &t) {
  std::array<Number, 3> p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    p[axis] =
        Number(ray.origin[axis]) - Number(double(cell[axis])) + t * Number(ray.direction[axis]);
  }
  return p;
}

template <class Number>
bool append_changes_in_cell(const std::array<double, 8> &v, double isovalue, const OracleRay &ray,
                            const std::array<int, 3> &cell, const Number &t_enter,
                            const Number &t_exit, int max_depth, Changes &changes) {
  const std::array<Number, 3> p = position(ray, cell, t_enter);
  const Number length = t_exit - t_enter;
  std::array<Number, 3> e;
  for (std::size_t axis = 0; axis < 3; ++axis) e[axis] = length * Number(ray.direction[axis]);
  return append_changes(bernstein(along_segment(v, isovalue, p, e)), 0.0, 1.0, 0, max_depth,
                        changes);
}

/// The same by intervals. Not inlined, so that no operation leaves the life of its RoundsUp.
[[gnu::noinline]] bool append_changes_by_intervals(const std::array<double, 8> &v, double isovalue,
                                                   const OracleRay &ray,
                                                   const std::array<int, 3> &cell,
                                                   const Crossing &enter, const Crossing &leave,
                                                   const RoundsUp &, Changes &changes) {
  return append_changes_in_cell(v, isovalue, ray, cell, enter.interval(), leave.interval(),
                                kMaxIntervalDepth, changes);
}

[[gnu::noinline]] bool append_changes_of_cubic(const std::array<double, 4> &b, const RoundsUp &,
                                               Changes &changes) {
  return append_changes(Polynomial<Interval>{b[0], b[1], b[2], b[3]}, 0.0, 1.0, 0,
                        kMaxIntervalDepth, changes);
}

bool lacks_data(const std::array<double, 8> &corners) {
  return std::ranges::any_of(corners, [](double value) { return std::isnan(value); });
}

/// Calls visit(cell, enter, leave) for each cell of the domain along the ray from t = begin on,
/// until visit returns true.
template <class Visit>
void walk_cells(const OracleRay &ray, const std::array<std::uint32_t, 3> &dims, double begin,
                Visit visit) {
  const auto crossing = [&](std::size_t axis, int plane) {
    Crossing c;
    c.plane = plane;
    c.origin = ray.origin[axis];
    c.direction = ray.direction[axis];
    c.t = (c.plane - c.origin) / c.direction;
    c.axis = static_cast<int>(axis);
    return c;
  };
  Crossing enter, exit;
  enter.plane = enter.t = begin;
  std::array<int, 3> cell{}, step{};
  for (std::size_t axis = 0; axis < 3; ++axis) {  // clip to the domain
    const int last = static_cast<int>(dims[axis]) - 1;
    if (ray.direction[axis] == 0) {
      if (!(ray.origin[axis] >= 0 && ray.origin[axis] <= last)) return;
      continue;
    }
    step[axis] = ray.direction[axis] > 0 ? 1 : -1;
    const Crossing in = crossing(axis, step[axis] > 0 ? 0 : last),
                   out = crossing(axis, step[axis] > 0 ? last : 0);
    if (compare(in, enter) > 0) enter = in;
    if (compare(out, exit) < 0) exit = out;
  }
  if (compare(enter, exit) >= 0) return;

  std::array<Crossing, 3> next;  // the plane at which each axis leaves its current cell
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int last_cell = static_cast<int>(dims[axis]) - 2;
    const double x = ray.origin[axis] + enter.t * ray.direction[axis];
    cell[axis] = std::clamp(static_cast<int>(std::floor(x)), 0, last_cell);
    if (step[axis] == 0) continue;
    const auto leaves = [&](int c) { return crossing(axis, step[axis] > 0 ? c + 1 : c); };
    // The rounded position is a guess: the cell is the one whose exit is the first after the entry.
    while (cell[axis] - step[axis] >= 0 && cell[axis] - step[axis] <= last_cell &&
           compare(leaves(cell[axis] - step[axis]), enter) > 0) {
      cell[axis] -= step[axis];
    }
    while (cell[axis] + step[axis] >= 0 && cell[axis] + step[axis] <= last_cell &&
           compare(leaves(cell[axis]), enter) <= 0) {
      cell[axis] += step[axis];
    }
    next[axis] = leaves(cell[axis]);
  }

  for (;;) {
    std::size_t axis = 0;
    for (std::size_t other = 1; other < 3; ++other) {
      if (compare(next[other], next[axis]) < 0) axis = other;
    }
    const Crossing leave = next[axis];
    if (compare(enter, leave) < 0 && visit(cell, enter, leave)) return;
    cell[axis] += step[axis];
    if (cell[axis] < 0 || cell[axis] > static_cast<int>(dims[axis]) - 2) return;
    next[axis] = crossing(axis, step[axis] > 0 ? cell[axis] + 1 : cell[axis]);
    enter = leave;
  }
}

}  // namespace

RootOracle::RootOracle(std::span<const float> voxels, std::array<std::uint32_t, 3> dims,
                       float isovalue)
    : voxels_(voxels), dims_(dims), isovalue_(isovalue) {
  if (voxels.size() != std::size_t{dims[0]} * dims[1] * dims[2] ||
      *std::min_element(dims.begin(), dims.end()) < 2) {
    throw std::invalid_argument("RootOracle: the voxels do not fit the dims");
  }
}

std::array<double, 8> RootOracle::corners(const std::array<int, 3> &cell) const {
  std::array<double, 8> v;
  for (unsigned corner = 0; corner < 8; ++corner) {
    const std::size_t x = static_cast<std::size_t>(cell[0]) + (corner & 1u),
                      y = static_cast<std::size_t>(cell[1]) + (corner >> 1 & 1u),
                      z = static_cast<std::size_t>(cell[2]) + (corner >> 2);
    v[corner] = voxels_[x + dims_[0] * (y + std::size_t{dims_[1]} * z)];
  }
  return v;
}

std::optional<bool> RootOracle::inside(const OracleRay &ray, double t) const {
  std::array<int, 3> cell;
  std::array<mpq_class, 3> p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int last_cell = static_cast<int>(dims_[axis]) - 2;
    p[axis] = mpq_class(ray.origin[axis]) + mpq_class(t) * mpq_class(ray.direction[axis]);
    p[axis] = std::clamp(p[axis], mpq_class(0), mpq_class(last_cell + 1));
    cell[axis] = std::min(static_cast<int>(mpz_class(p[axis]).get_si()), last_cell);
    p[axis] -= cell[axis];
  }
  const std::array<double, 8> v = corners(cell);
  if (lacks_data(v)) return std::nullopt;
  const std::array<mpq_class, 3> nowhere{0, 0, 0};
  return side(along_segment<mpq_class>(v, isovalue_, p, nowhere)[0]) == Side::kInside;
}

OracleHit RootOracle::first_hit(const OracleRay &ray, double begin) const {
  const std::vector<OracleChange> changes = this->changes(ray, begin, 1);
  return changes.empty() ? OracleHit{} : OracleHit{true, changes[0].t, changes[0].cell};
}

std::vector<OracleChange> RootOracle::changes(const OracleRay &ray, double begin,
                                              std::size_t most) const {
  std::vector<OracleChange> result;
  bool behind_gap = false;
  walk_cells(ray, dims_, begin, [&](const auto &cell, const Crossing &enter, const auto &leave) {
    const std::array<double, 8> v = corners(cell);
    const bool inside = v[0] >= isovalue_;
    const bool mixed =
        std::any_of(v.begin() + 1, v.end(), [&](double x) { return (x >= isovalue_) != inside; });
    if (lacks_data(v)) {
      behind_gap = true;
    } else if (mixed) {
      const std::size_t wanted = most - result.size();
      Changes in_cell{wanted};
      if (!append_changes_by_intervals(v, isovalue_, ray, cell, enter, leave, RoundsUp(),
                                       in_cell)) {
        ++num_exact_cells_;
        in_cell = {wanted};
        append_changes_in_cell<mpq_class>(v, isovalue_, ray, cell, enter.exact(), leave.exact(),
                                          kMaxDepth, in_cell);
      }
      for (const Change &change : in_cell.found) {
        result.push_back({enter.t + change.s * (leave.t - enter.t), cell, change.enters,
                          std::exchange(behind_gap, false)});
      }
    }
    return result.size() >= most;
  });
  return result;
}

std::vector<double> RootOracle::borders(const OracleRay &ray) const {
  std::vector<double> result;
  double end = 0;
  bool had_data = false;
  walk_cells(ray, dims_, 0, [&](const auto &cell, const Crossing &enter, const Crossing &leave) {
    const bool has_data = !lacks_data(corners(cell));
    if (has_data != had_data) result.push_back(enter.t);
    had_data = has_data;
    end = leave.t;
    return false;
  });
  if (had_data) result.push_back(end);
  return result;
}

double RootOracle::field(const std::array<double, 3> &point) const {
  std::array<int, 3> cell;
  std::array<double, 3> p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cell[axis] =
        std::clamp(static_cast<int>(std::floor(point[axis])), 0, static_cast<int>(dims_[axis]) - 2);
    p[axis] = point[axis] - cell[axis];
  }
  return along_segment<double>(corners(cell), 0.0, p, {0.0, 0.0, 0.0})[0];
}

std::array<double, 3> RootOracle::gradient(const std::array<double, 3> &point) const {
  std::array<int, 3> cell;
  std::array<double, 3> p;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cell[axis] =
        std::clamp(static_cast<int>(std::floor(point[axis])), 0, static_cast<int>(dims_[axis]) - 2);
    p[axis] = point[axis] - cell[axis];
  }
  std::array<double, 3> result;
  for (std::size_t axis = 0; axis < 3;
       ++axis) {  // the derivative along an axis is the linear term there
    std::array<double, 3> e{};
    e[axis] = 1.0;
    result[axis] = along_segment<double>(corners(cell), 0.0, p, e)[1];
  }
  return result;
}

std::optional<double> first_change_of_cubic(const std::array<double, 4> &b) {
  Changes first{1};
  if (!append_changes_of_cubic(b, RoundsUp(), first)) {
    first = {1};
    append_changes(Polynomial<mpq_class>{b[0], b[1], b[2], b[3]}, 0.0, 1.0, 0, kMaxDepth, first);
  }
  if (first.found.empty()) return std::nullopt;
  return first.found[0].s;
}

}  // namespace isowave::core
