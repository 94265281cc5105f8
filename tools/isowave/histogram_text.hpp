#pragma once
// A histogram with suggested isovalues, as text for terminals.

#include <string>

#include "core/zfp/isovalue_suggestions.hpp"

namespace isowave::core::tools {

/// Whether the environment says that output is UTF-8: LC_ALL, LC_CTYPE or LANG, the first that is
/// not empty.
bool prints_utf8();

/// Lines of bars, 64 columns and 8 rows, whose heights are logarithms of counts; below them an axis
/// with the numbers of suggestions (1 is the first), and the least and largest value.
///
/// blocks  draws bars by the block characters of Unicode instead of ASCII
std::string histogram_text(const IsovalueSuggestions &suggestions, bool blocks);

/// The suggestions in one line, each with how it was found.
std::string suggestions_line(const IsovalueSuggestions &suggestions);

}  // namespace isowave::core::tools
