#pragma once
// Lines and fields of the text headers of NRRD and MetaImage: bounded memory, linear time, every
// value read whole.

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "core/io/byte_source.hpp"

namespace isowave::core {

/// Without blanks, tabs and carriage returns at both ends.
std::string_view trim(std::string_view text);
/// The parts between blanks and tabs.
std::vector<std::string_view> split_words(std::string_view text);
/// The start of a text, in quotes.
std::string quote(std::string_view text);

/// As parse_all() in core/base/text.hpp, also with a plus before the number.
std::optional<double> parse_number(std::string_view text);
std::optional<std::int64_t> parse_integer(std::string_view text);

/// The lines of a file, one by one.
class HeaderLines {
 public:
  static constexpr std::size_t kMaxLength = 1u << 16;

  explicit HeaderLines(const std::shared_ptr<const InputFile> &file) : source_(file, 0) {}

  /// Goes on to the next line. False at the end of the file.
  bool next();
  /// The line without its end (\n or \r\n); of a line longer than kMaxLength only that much, and
  /// is_cut(). The rest is read only to get to the next line.
  std::string_view line() const { return line_; }
  bool is_cut() const { return is_cut_; }
  std::uint64_t number() const { return number_; }
  /// Bytes of the file up to the end of a line that is not cut, line end included.
  std::uint64_t end() const { return end_; }

 private:
  /// Reads on when the buffer is used up. False at the end of the file.
  bool refill();
  /// Moves at most that many bytes of the buffer to the line. Returns whether it has ended.
  bool add_up_to(std::size_t most);

  FileSource source_;
  std::vector<std::byte> buffer_;
  std::size_t position_ = 0;  ///< of what is next in the buffer
  std::string line_;
  bool is_cut_ = false;
  std::uint64_t number_ = 0, end_ = 0;
};

/// The fields of a header, each given once. All functions throw Error that names the file and the
/// field.
class HeaderFields {
 public:
  explicit HeaderFields(std::string what) : what_(std::move(what)) {}

  void add(std::string_view name, std::string_view value);
  bool has(std::string_view name) const { return fields_.find(name) != fields_.end(); }
  /// Fails if the field is missing.
  const std::string &operator[](std::string_view name) const;
  /// A number or an integer, the only one of the field.
  double number(std::string_view name) const;
  std::int64_t integer(std::string_view name) const;
  /// `count` of them.
  enum class Nan { kRefused, kUnknown };
  std::vector<double> numbers(std::string_view name, std::size_t count,
                              Nan nan = Nan::kRefused) const;
  std::vector<std::int64_t> integers(std::string_view name, std::size_t count) const;
  std::vector<std::string_view> words(std::string_view name, std::size_t count) const;
  [[noreturn]] void fail(std::string_view name, std::string_view reason) const;

 private:
  std::string what_;
  std::map<std::string, std::string, std::less<>> fields_;
};

}  // namespace isowave::core
