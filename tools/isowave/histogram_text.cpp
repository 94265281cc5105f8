#include "tools/isowave/histogram_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "core/base/text.hpp"

namespace isowave::core::tools {

namespace {

constexpr std::size_t kColumns = 64, kRows = 8, kEighths = 8;  ///< of a row, to which bars end
using Glyphs = std::array<const char *, kEighths + 1>;
constexpr Glyphs kAscii = {" ", ".", ".", ".", ":", ":", ":", "|", "#"};
constexpr Glyphs kBlocks = {" ", "▁", "▂", "▃", "▄", "▅", "▆", "▇", "█"};

/// Heights of columns [eighths of a row]; any voxel gives at least one.
std::array<std::size_t, kColumns> heights_of(const IsovalueSuggestions &suggestions) {
  std::array<double, kColumns> counts{};
  for (std::size_t bin = 0; bin < kHistogramBins; ++bin)
    counts.at(bin * kColumns / kHistogramBins) += double(suggestions.counts.at(bin));
  const double most = std::log1p(*std::ranges::max_element(counts));
  std::array<std::size_t, kColumns> heights{};
  std::ranges::transform(counts, heights.begin(), [&](double count) {
    return static_cast<std::size_t>(std::ceil(std::log1p(count) / most * kRows * kEighths));
  });
  return heights;
}

}  // namespace

bool prints_utf8() {
  for (const char *name : {"LC_ALL", "LC_CTYPE", "LANG"}) {
    const char *const value = std::getenv(name);
    if (value == nullptr || *value == '\0') continue;
    const std::string locale = lower_case(value);
    return locale.find("utf-8") != std::string::npos || locale.find("utf8") != std::string::npos;
  }
  return false;
}

std::string histogram_text(const IsovalueSuggestions &suggestions, bool blocks) {
  const Glyphs &glyphs = blocks ? kBlocks : kAscii;
  const std::array<std::size_t, kColumns> heights = heights_of(suggestions);
  std::string text;
  for (std::size_t row = kRows; row-- > 0;) {
    std::string line;
    for (const std::size_t height : heights)
      line += glyphs.at(std::clamp(height, row * kEighths, (row + 1) * kEighths) - row * kEighths);
    text += line.substr(0, line.find_last_not_of(' ') + 1) + "\n";
  }
  const auto [least, largest] = suggestions.range;
  std::string axis(kColumns, '-');
  for (std::size_t i = suggestions.isovalues.size(); i-- > 0;) {
    const double place = (suggestions.isovalues[i].isovalue - least) / (largest - least);
    axis[std::min(kColumns - 1, static_cast<std::size_t>(place * kColumns))] =
        static_cast<char>('1' + i);
  }
  const std::string left = fmt::format("{:.6g}", least);
  return text + axis + "\n" +
         fmt::format("{}{:>{}}\n", left, fmt::format("{:.6g}", largest), kColumns - left.size());
}

std::string suggestions_line(const IsovalueSuggestions &suggestions) {
  std::string line;
  for (const SuggestedIsovalue &suggested : suggestions.isovalues) {
    line += fmt::format("{}{} ({})", line.empty() ? "" : ", ", suggested.isovalue,
                        to_string(suggested.by));
  }
  return line;
}

}  // namespace isowave::core::tools
