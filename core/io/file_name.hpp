#pragma once
// Names of outputs must not promise another format than the file has.

#include <filesystem>
#include <initializer_list>
#include <string_view>

namespace isowave::core {

/// content: a sentence, "pictures are written as PNG". endings: in lower case; case does not
/// matter. A name without an extension, and an empty one, promise nothing.
///
/// Throws  Error: the name ends otherwise
void check_ending(const std::filesystem::path &name, std::string_view content,
                  std::initializer_list<std::string_view> endings);

void check_png_name(const std::filesystem::path &name);
void check_npy_name(const std::filesystem::path &name);
void check_json_name(const std::filesystem::path &name);

}  // namespace isowave::core
