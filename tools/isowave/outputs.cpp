#include "tools/isowave/outputs.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <system_error>

#include "core/base/error.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/open_volume.hpp"
#include "core/platform/names_in.hpp"
#include "core/platform/new_file.hpp"
#include "core/volume/volume.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace fs = std::filesystem;

namespace {

/// The same for all names of a file that exists; for one that does not, its folder and name. Throws
/// Error if it can be neither.
std::string key_of(const fs::path &path) {
  const fs::path target = follow_links(path);
  std::error_code failure, no_folder;
  std::string key = platform::identity_of(target, failure);
  if (!failure) return key;
  const fs::path folder = target.has_parent_path() ? target.parent_path() : fs::path(".");
  const std::string folder_key = platform::identity_of(folder, no_folder);
  if (failure == std::errc::no_such_file_or_directory && !no_folder)
    return fmt::format("{}/{}", folder_key, target.filename().string());
  throw Error("{}: cannot write: {}", path.string(), failure.message());
}

/// Standard output has the command's messages.
void refuse_standard_output(const std::string &option, const fs::path &path) {
  if (path == "-")
    throw Error("{} -: cannot write to standard output: give a name, ./- for a file '-'", option);
}

}  // namespace

void Outputs::read(const fs::path &path) {
  std::error_code failure;
  if (fs::exists(path, failure))
    users_.emplace(key_of(path), fmt::format("the input {}", path.string()));
}

void Outputs::read_volume(const std::string &path) {
  if (path.starts_with(kGenerate)) return;
  std::error_code failure;
  if (!fs::exists(path, failure)) return;
  read(path);
  visit_voxel_files(path, [&](const fs::path &file) { read(file); });
}

void Outputs::write(const std::string &option, const fs::path &path) {
  if (path.empty()) return;
  refuse_standard_output(option, path);
  const fs::path folder = follow_links(path).parent_path();
  std::error_code failure;
  if (!folder.empty() && !fs::is_directory(folder, failure))
    throw Error("cannot write {}: {} is no folder", path.string(), folder.string());
  const auto [user, is_new] =
      users_.emplace(key_of(path), fmt::format("{} {}", option, path.string()));
  if (!is_new)
    throw Error("{} {}: it would take the place of {}", option, path.string(), user->second);
  // The first of many frames' files shows if the folder can be written to; an existing file, if it
  // may be replaced.
  if (probed_.insert(folder).second || fs::exists(path, failure)) AtomicFile{path};
}

bool Outputs::write_folder(const std::string &option, const fs::path &folder) {
  refuse_standard_output(option, folder);
  std::error_code failure;
  fs::path existing = folder,
           made;  // the deepest folder that is there, and the one that will be made in it
  while (!fs::exists(existing, failure) && existing.has_relative_path()) {
    if (!existing.filename().empty()) made = existing;
    existing = existing.has_parent_path() ? existing.parent_path() : fs::path(".");
  }
  if (!fs::is_directory(existing, failure))
    throw Error("cannot make the folder {}: {} is no folder", folder.string(), existing.string());
  if (!platform::can_fill(existing, failure))
    throw Error("cannot make or fill the folder {}: {}", folder.string(), failure.message());
  if (made.empty()) return false;
  new_folder_ = folder;
  if (const auto user = users_.find(key_of(made)); user != users_.end())
    throw Error("{} {}: it would take the place of {}", option, folder.string(), user->second);
  return true;
}

void Outputs::write_pictures(const std::string &option, const fs::path &folder,
                             const std::string &prefix) {
  if (folder.empty() || write_folder(option, folder)) return;
  std::error_code failure;
  const std::string folder_key = platform::identity_of(folder, failure);
  if (failure) return;
  for (const std::string &name : platform::names_in(folder)) {
    if (!name.starts_with(prefix) || !name.ends_with(".png") || !fs::exists(folder / name, failure))
      continue;
    if (const auto user = users_.find(key_of(folder / name)); user != users_.end())
      throw Error("{} {}: {} could take the place of {}", option, folder.string(), name,
                  user->second);
  }
  const std::string in_folder = fmt::format("{}/{}", folder_key, prefix);
  for (const auto &[key, user] : users_) {
    if (key.starts_with(in_folder) && key.ends_with(".png"))
      throw Error("{} {}: a picture could take the place of {}", option, folder.string(), user);
  }
}

void Outputs::make_folder() const {
  if (!new_folder_.empty()) OutputGroup::current()->make_folder(new_folder_);
}

}  // namespace isowave::core::tools
