#include "tools/isowave/strict_options.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "core/base/error.hpp"
#include "core/base/text.hpp"

namespace isowave::core::tools {

namespace {

/// Returns what is wrong with the value, or nothing. Writes whole numbers anew: CLI11 reads 010
/// as 8.
std::string check_number(const std::string &type, std::string &value) {
  if (type.starts_with("UINT")) {
    const std::optional<std::uint64_t> number = parse_whole(value);
    if (!number) return fmt::format("'{}' is no whole number from 0 to 2^64 - 1", value);
    value = std::to_string(*number);
  } else if (type.starts_with("INT")) {
    const std::optional<std::int64_t> number = parse_all<std::int64_t>(value);
    if (!number) return fmt::format("'{}' is no whole number of at most 64 bits", value);
    value = std::to_string(*number);
  } else if (type.starts_with("FLOAT")) {
    if (!parse_finite(value))
      return fmt::format("'{}' is no finite number that float64 holds", value);
  }
  return {};
}

/// All options of the app and of its subcommands.
template <class Use>
void for_options(CLI::App &app, const Use &use) {
  for (CLI::Option *option : app.get_options()) use(app, *option);
  for (CLI::App *command : app.get_subcommands([](CLI::App *) { return true; }))
    for_options(*command, use);
}

bool has_empty_entry(std::string_view list, char delimiter) {
  if (list.starts_with(delimiter) || list.ends_with(delimiter)) return true;
  return list.find(std::string(2, delimiter)) != list.npos;
}

}  // namespace

std::optional<std::uint64_t> parse_whole(std::string_view text) {
  return parse_all<std::uint64_t>(text);
}

std::optional<double> parse_finite(std::string_view text) {
  const std::optional<double> number = parse_all<double>(text);
  return number && std::isfinite(*number) ? number : std::nullopt;
}

std::optional<std::uint64_t> parse_bytes(std::string_view text) {
  constexpr std::string_view kPrefixes = "kmgtpe";
  const std::size_t digits = std::min(text.find_first_not_of("0123456789"), text.size());
  const std::optional<std::uint64_t> number = parse_whole(text.substr(0, digits));
  std::string unit = CLI::detail::to_lower(std::string(text.substr(digits)));
  unit.erase(0, std::min(unit.find_first_not_of(' '), unit.size()));
  if (!unit.empty() && unit.back() == 'b') unit.pop_back();
  const bool binary = unit.size() == 2 && unit.back() == 'i';
  if (binary) unit.pop_back();
  const std::size_t power = unit.empty() ? 0 : kPrefixes.find(unit) + 1;
  if (!number || unit.size() > 1 || (!unit.empty() && power == 0)) return {};
  std::uint64_t bytes = *number;
  for (std::size_t i = 0; i < power; ++i) {
    if (__builtin_mul_overflow(bytes, binary ? 1024u : 1000u, &bytes)) return {};
  }
  if (bytes == 0) return {};
  return bytes;
}

void make_strict(CLI::App &app) {
  for_options(app, [](CLI::App &command, CLI::Option &option) {
    if (option.get_items_expected_max() == 0) return;  // a flag
    const auto check = [&command,
                        type = option.get_type_name()](std::string &value) -> std::string {
      if (value.empty()) return "the value is empty";
      if (value.starts_with('-') && command.get_option_no_throw(value) != nullptr)
        return fmt::format("a value is missing before {}", value);
      return check_number(type, value);
    };
    option.transform(CLI::Validator(check, ""));  // before other checks
  });
}

void refuse_empty_values(CLI::App &app, int argc, char **argv) {
  for (int i = 1; i < argc; ++i) {
    const std::string_view argument = argv[i];
    if (argument == "--") return;
    if (!argument.starts_with('-')) continue;
    const std::size_t equals = argument.find('=');
    const std::string name(argument.substr(0, equals));
    if (equals == argument.size() - 1) throw Error("{}: the value is empty", name);
    const std::string_view value = equals != argument.npos ? argument.substr(equals + 1)
                                   : i + 1 < argc          ? argv[i + 1]
                                                           : "";
    for_options(app, [&](CLI::App &, const CLI::Option &option) {
      if (option.get_delimiter() != '\0' && option.check_name(name) &&
          has_empty_entry(value, option.get_delimiter()))
        throw Error("{}: an entry of '{}' is empty", name, value);
    });
  }
}

std::vector<std::string_view> split_at_commas(std::string_view text) {
  std::vector<std::string_view> fields;
  for (std::size_t begin = 0, end = 0; end != text.npos; begin = end + 1) {
    end = text.find(',', begin);
    fields.push_back(text.substr(begin, end - begin));
  }
  return fields;
}

CLI::Validator fits_float32() {
  return CLI::Validator(
      [](std::string &value) -> std::string {
        const std::optional<double> number = parse_finite(value);
        if (number && std::abs(*number) <= std::numeric_limits<float>::max()) return {};
        return fmt::format("'{}' is no finite number that float32 holds", value);
      },
      "");
}

CLI::Validator any_number() {
  return CLI::Validator(
      [](std::string &value) -> std::string {
        std::string name = lower_case(value);
        if (name.starts_with('-') || name.starts_with('+')) name.erase(0, 1);
        if (parse_finite(value) || name == "nan" || name == "inf") return {};
        return fmt::format("'{}' is no number that float64 holds, nor nan, inf or -inf", value);
      },
      "");
}

CLI::Validator byte_count() {
  return CLI::Validator(
      [](std::string &value) -> std::string {
        const std::optional<std::uint64_t> bytes = parse_bytes(value);
        if (!bytes)
          return fmt::format("'{}' is no number of bytes from 1 to 2^64 - 1, such as 600MB or 1GiB",
                             value);
        value = std::to_string(*bytes);
        return {};
      },
      "");
}

CLI::Validator count_or_all() {
  return CLI::Validator(
      [](std::string &value) -> std::string {
        const bool all = value == "all";
        const std::uint32_t number = all ? 0 : parse_all<std::uint32_t>(value).value_or(0);
        if (number == 0 && !all)
          return fmt::format("'{}' is neither a whole number above 0 nor all", value);
        value = std::to_string(number);
        return {};
      },
      "");
}

void refuse_options(const CLI::App &command, std::initializer_list<const char *> names,
                    std::string_view why) {
  for (const char *name : names) {
    if (command.count(name) > 0) throw Error("{}: {}", name, why);
  }
}

}  // namespace isowave::core::tools
