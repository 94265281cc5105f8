#pragma once
// Options that take what they say and nothing else. CLI11 by itself takes '' for 0, -1 for 2^64 -
// 1, 010 for 8, 1e400 for infinity and the next option for a value.

#include <CLI/CLI.hpp>
#include <cstdint>
#include <initializer_list>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace isowave::core::tools {

/// Makes every option of the program and its subcommands refuse, by name and in one line: an empty
/// value; an option's name in the place of a value; for a number anything but a decimal one in its
/// range, so also nan and inf.
void make_strict(CLI::App &app);
/// Throws Error on `--name=` with nothing behind it, for which CLI11 would take the next argument,
/// and on `a,,b`.
void refuse_empty_values(CLI::App &app, int argc, char **argv);

/// The whole text as a decimal number; none if it is not one, or out of range.
std::optional<std::uint64_t> parse_whole(std::string_view text);
std::optional<double> parse_finite(std::string_view text);
/// "12kB" is 12000, "1KiB" is 1024, "12" is 12; none if it is not such a number above 0, or more
/// than 64 bits hold.
std::optional<std::uint64_t> parse_bytes(std::string_view text);

/// The fields between commas, also empty ones.
std::vector<std::string_view> split_at_commas(std::string_view text);

/// A validator: a number that float32 can hold without becoming infinite.
CLI::Validator fits_float32();
/// A number that float64 holds, or nan, inf, -inf; for an option of type_name("NUMBER").
CLI::Validator any_number();
/// A transformer: a number of bytes above 0, such as 600MB (1000^2) or 1GiB (1024^3), to digits.
CLI::Validator byte_count();
/// A transformer: a whole number above 0, or "all" to 0.
CLI::Validator count_or_all();

/// Throws Error, "OPTION: WHY", if one of the options was given on the command line.
void refuse_options(const CLI::App &command, std::initializer_list<const char *> names,
                    std::string_view why);

}  // namespace isowave::core::tools
