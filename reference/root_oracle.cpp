#include "reference/root_oracle.hpp"

#include <gmpxx.h>

#include <algorithm>
#include <boost/numeric/interval.hpp>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>
#include <vector>

namespace isowave::core {

namespace {

using Interval = boost::numeric::interval<double>;

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

/// Knowledge of the first change of inside on a piece of the segment.
struct Answer {
  enum Kind { kNone, kChange, kUndecided } kind;
  double s = 0;
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

Answer undecided_piece(const Polynomial<Interval> &, double) {
  return {Answer::kUndecided};
}

/// inside at the ends is alike (else the caller knows of a change): two near roots, one double
/// root, or none.
Answer undecided_piece(const Polynomial<mpq_class> &b, double s) {
  if (side(b[0]) != side(b[3])) return {Answer::kChange, s};
  if (side(b[0]) == Side::kOutside) {  // touching the isovalue is already inside
    return {count_distinct_roots(b) > 0 ? Answer::kChange : Answer::kNone, s};
  }
  const bool ends_on_zero = b[0] == 0 || b[3] == 0;
  return {count_distinct_roots(b) - (ends_on_zero ? 1 : 0) > 1 ? Answer::kChange : Answer::kNone,
          s};
}

/// The first change of inside on the piece [begin, begin + width] of [0,1], leftmost first.
template <class Number>
Answer first_change(const Polynomial<Number> &b, double begin, double width, int depth,
                    int max_depth) {
  std::array<Side, 4> sides;
  for (unsigned i = 0; i < 4; ++i) sides[i] = side(b[i]);
  if (sides[0] == Side::kUnknown) return {Answer::kUndecided};
  const bool known = std::find(sides.begin(), sides.end(), Side::kUnknown) == sides.end();
  int variations = 0;
  for (unsigned i = 1; i < 4; ++i) variations += sides[i] != sides[i - 1];
  if (known && variations == 0)
    return {Answer::kNone};  // the curve lies in the hull of its coefficients
  if (known && variations == 1)
    return {Answer::kChange, begin + width * place_of_root(b)};  // Descartes
  if (depth >= max_depth) return undecided_piece(b, begin + 0.5 * width);
  const auto [left, right] = halves(b);
  const Answer in_left = first_change(left, begin, 0.5 * width, depth + 1, max_depth);
  if (in_left.kind != Answer::kNone) return in_left;
  return first_change(right, begin + 0.5 * width, 0.5 * width, depth + 1, max_depth);
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
Answer change_in_cell(const std::array<double, 8> &v, double isovalue, const OracleRay &ray,
                      const std::array<int, 3> &cell, const Number &t_enter, const Number &t_exit,
                      int max_depth) {
  const std::array<Number, 3> p = position(ray, cell, t_enter);
  const Number length = t_exit - t_enter;
  std::array<Number, 3> e;
  for (std::size_t axis = 0; axis < 3; ++axis) e[axis] = length * Number(ray.direction[axis]);
  return first_change(bernstein(along_segment(v, isovalue, p, e)), 0.0, 1.0, 0, max_depth);
}

bool lacks_data(const std::array<double, 8> &corners) {
  return std::ranges::any_of(corners, [](double value) { return std::isnan(value); });
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
    const int last = static_cast<int>(dims_[axis]) - 1;
    if (ray.direction[axis] == 0) {
      if (!(ray.origin[axis] >= 0 && ray.origin[axis] <= last)) return {};
      continue;
    }
    step[axis] = ray.direction[axis] > 0 ? 1 : -1;
    const Crossing in = crossing(axis, step[axis] > 0 ? 0 : last),
                   out = crossing(axis, step[axis] > 0 ? last : 0);
    if (compare(in, enter) > 0) enter = in;
    if (compare(out, exit) < 0) exit = out;
  }
  if (compare(enter, exit) >= 0) return {};

  std::array<Crossing, 3> next;  // the plane at which each axis leaves its current cell
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const int last_cell = static_cast<int>(dims_[axis]) - 2;
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
    const std::array<double, 8> v = corners(cell);
    const bool inside = v[0] >= isovalue_;
    const bool mixed =
        std::any_of(v.begin() + 1, v.end(), [&](double x) { return (x >= isovalue_) != inside; });
    if (mixed && !lacks_data(v) && compare(enter, leave) < 0) {
      Answer answer = change_in_cell<Interval>(v, isovalue_, ray, cell, enter.interval(),
                                               leave.interval(), kMaxIntervalDepth);
      if (answer.kind == Answer::kUndecided) {
        ++num_exact_cells_;
        answer = change_in_cell<mpq_class>(v, isovalue_, ray, cell, enter.exact(), leave.exact(),
                                           kMaxDepth);
      }
      if (answer.kind == Answer::kChange)
        return {true, enter.t + answer.s * (leave.t - enter.t), cell};
    }
    cell[axis] += step[axis];
    if (cell[axis] < 0 || cell[axis] > static_cast<int>(dims_[axis]) - 2) return {};
    next[axis] = crossing(axis, step[axis] > 0 ? cell[axis] + 1 : cell[axis]);
    enter = leave;
  }
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
  Answer answer =
      first_change(Polynomial<Interval>{b[0], b[1], b[2], b[3]}, 0.0, 1.0, 0, kMaxIntervalDepth);
  if (answer.kind == Answer::kUndecided) {
    answer = first_change(Polynomial<mpq_class>{b[0], b[1], b[2], b[3]}, 0.0, 1.0, 0, kMaxDepth);
  }
  if (answer.kind != Answer::kChange) return std::nullopt;
  return answer.s;
}

}  // namespace isowave::core
