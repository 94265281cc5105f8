#pragma once
// Parts of C++20 that the library uses, and that libc++ 13 lacks. Debian's emscripten 3.1.6 has
// libc++ 13. The compiler includes this file before all others (-include).

#include <version>

#if defined(_LIBCPP_VERSION) && _LIBCPP_VERSION < 16000

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstdlib>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <type_traits>
#include <utility>

namespace std {

template <class To, class From>
constexpr To bit_cast(const From &from) noexcept {
  return __builtin_bit_cast(To, from);
}

template <class Array>
unique_ptr<Array> make_unique_for_overwrite(size_t size) {
  return unique_ptr<Array>(new remove_extent_t<Array>[size]);
}

/// A thread that is waited for. Nothing asks it to stop.
class jthread : public thread {
 public:
  using thread::thread;
  jthread(jthread &&) noexcept = default;
  jthread &operator=(jthread &&) noexcept = default;
  ~jthread() {
    if (joinable()) join();
  }
};

/// Numbers in decimal, infinities and NaN, in the locale "C". No blanks, no plus.
template <class Float>
requires is_floating_point_v<Float> from_chars_result from_chars(const char *begin, const char *end,
                                                                 Float &value) {
  const string text(begin, end);
  if (text.empty() || text[0] == '+' || isspace(static_cast<unsigned char>(text[0])) != 0)
    return {begin, errc::invalid_argument};
  char *behind = nullptr;
  errno = 0;
  const Float parsed = is_same_v<Float, float> ? static_cast<Float>(strtof(text.c_str(), &behind))
                                               : static_cast<Float>(strtod(text.c_str(), &behind));
  const ptrdiff_t length = behind - text.c_str();
  if (length == 0) return {begin, errc::invalid_argument};
  if (errno == ERANGE) return {begin + length, errc::result_out_of_range};
  value = parsed;
  return {begin + length, errc{}};
}

namespace ranges {

/// A comparison, or test, of what the projections make of elements.
template <class Of, class Projection>
auto projected(Of of, Projection projection) {
  return [of, projection](const auto &...elements) {
    return invoke(of, invoke(projection, elements)...);
  };
}

template <class Range, class Value, class Projection = identity>
auto find(Range &&range, const Value &value, Projection projection = {}) {
  return std::find_if(std::begin(range), std::end(range),
                      [&](const auto &element) { return invoke(projection, element) == value; });
}
template <class Range, class Test>
auto find_if(Range &&range, Test test) {
  return std::find_if(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Test>
auto find_if_not(Range &&range, Test test) {
  return std::find_if_not(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Test>
bool any_of(Range &&range, Test test) {
  return std::any_of(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Test>
bool all_of(Range &&range, Test test) {
  return std::all_of(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Test>
bool none_of(Range &&range, Test test) {
  return std::none_of(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Test>
auto count_if(Range &&range, Test test) {
  return std::count_if(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Test>
auto partition_point(Range &&range, Test test) {
  return std::partition_point(std::begin(range), std::end(range), projected(test, identity()));
}
template <class Range, class Value>
auto lower_bound(Range &&range, const Value &value) {
  return std::lower_bound(std::begin(range), std::end(range), value);
}
template <class Range, class Out>
void copy(Range &&range, Out out) {
  std::copy(std::begin(range), std::end(range), out);
}
template <class Range, class Value>
void fill(Range &&range, const Value &value) {
  std::fill(std::begin(range), std::end(range), value);
}
template <class Range>
void reverse(Range &&range) {
  std::reverse(std::begin(range), std::end(range));
}
template <class Range, class Comparison = std::less<>, class Projection = identity>
void sort(Range &&range, Comparison comparison = {}, Projection projection = {}) {
  std::sort(std::begin(range), std::end(range), projected(comparison, projection));
}
template <class Range, class Comparison = std::less<>, class Projection = identity>
void stable_sort(Range &&range, Comparison comparison = {}, Projection projection = {}) {
  std::stable_sort(std::begin(range), std::end(range), projected(comparison, projection));
}
template <class Range>
auto max_element(Range &&range) {
  return std::max_element(std::begin(range), std::end(range));
}
template <class Range>
auto max(Range &&range) {
  return *std::max_element(std::begin(range), std::end(range));
}
template <class Range>
auto min(Range &&range) {
  return *std::min_element(std::begin(range), std::end(range));
}
template <class Range, class Out, class Function>
void transform(Range &&range, Out out, Function function) {
  std::transform(std::begin(range), std::end(range), out, projected(function, identity()));
}
template <class First, class Second, class Out, class Function>
void transform(First &&first, Second &&second, Out out, Function function) {
  std::transform(std::begin(first), std::end(first), std::begin(second), out, function);
}

}  // namespace ranges
}  // namespace std

#endif
