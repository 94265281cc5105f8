#include "core/io/atomic_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <stdexcept>
#include <system_error>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/platform/new_file.hpp"
#include "core/platform/process.hpp"

namespace isowave::core {
namespace fs = std::filesystem;

namespace {

[[noreturn]] void fail(const fs::path &target, const std::error_code &reason) {
  throw Error("{}: cannot write: {}", target.string(), reason.message());
}

/// Fails after a call of the C library, which may not say why.
[[noreturn]] void fail_by_errno(const fs::path &target) {
  fail(target, {errno != 0 ? errno : EIO, std::generic_category()});
}

}  // namespace

fs::path follow_links(const fs::path &path) {
  constexpr int kMostLinks = 40;  // as many as Linux follows
  fs::path target = path;
  for (int i = 0; i < kMostLinks; ++i) {
    std::error_code failure;
    const fs::path next = fs::read_symlink(target, failure);
    if (failure) return target;
    target = next.is_absolute() ? next : target.parent_path() / next;
  }
  fail(path, std::make_error_code(std::errc::too_many_symbolic_link_levels));
}

AtomicFile::AtomicFile(const fs::path &target) : target_(follow_links(target)) {
  if (target_.filename().empty()) throw Error("'{}': cannot write: no file name", target.string());
  std::error_code failure;
  const fs::file_status status = fs::status(target_, failure);
  if (fs::exists(status)) {
    // rename() would replace a device such as /dev/null, and fails on a folder only after all the
    // work.
    if (!fs::is_regular_file(status))
      throw Error("{}: cannot write: it exists and is not a regular file", target.string());
    // It would replace a file that is not to be written, too.
    if (!platform::can_write(target_, failure)) fail(target, failure);
  } else if (failure != std::errc::no_such_file_or_directory) {
    fail(target, failure);
  }
  folder_ = target_.has_parent_path() ? target_.parent_path() : ".";
  if (const OutputGroup *group = OutputGroup::current()) folder_ = group->place_of(folder_);
  open_temporary();
  platform::keep_permissions(target_, file_);
}

void AtomicFile::choose_temporary_name() {
  static std::atomic<unsigned> next_id{0};
  // Not of the target's name, which may be as long as names may be.
  temporary_ =
      folder_ / fmt::format(".isowave.{}.{}.tmp", platform::process_id(), next_id.fetch_add(1));
}

void AtomicFile::open_temporary() {
  file_ = platform::make_nameless(folder_);
  nameless_ = file_ != nullptr;
  while (file_ == nullptr) {  // a killed process of the same number may have left such a file
    choose_temporary_name();
    std::error_code failure;
    file_ = platform::make_new(temporary_, failure);
    if (file_ == nullptr && failure != std::errc::file_exists) fail(target_, failure);
  }
}

AtomicFile::AtomicFile(AtomicFile &&other) noexcept
    : target_(std::move(other.target_)),
      folder_(std::move(other.folder_)),
      temporary_(std::move(other.temporary_)),
      old_(std::move(other.old_)),
      file_(std::exchange(other.file_, nullptr)),
      nameless_(other.nameless_),
      in_place_(other.in_place_) {
  other.temporary_.clear();
}

AtomicFile::~AtomicFile() {
  if (file_ != nullptr) std::fclose(file_);
  std::error_code failure;
  if (!nameless_ && !temporary_.empty()) fs::remove(temporary_, failure);
}

void AtomicFile::write(std::span<const std::byte> bytes) {
  if (bytes.empty()) return;  // their address may be null, which fwrite() does not want
  if (std::fwrite(bytes.data(), 1, bytes.size(), file_) != bytes.size()) fail_by_errno(target_);
}

void AtomicFile::read_back(const std::function<void(std::span<const std::byte>)> &take) {
  errno = 0;
  if (std::ferror(file_) != 0 || std::fseek(file_, 0, SEEK_SET) != 0) fail_by_errno(target_);
  std::vector<std::byte> piece(1u << 16);
  while (const std::size_t count = std::fread(piece.data(), 1, piece.size(), file_))
    take(std::span(piece).first(count));
  if (std::ferror(file_) != 0) fail_by_errno(target_);
}

void AtomicFile::commit() {
  errno = 0;
  if (std::ferror(file_) != 0 || std::fflush(file_) != 0) fail_by_errno(target_);
  if (OutputGroup *group = OutputGroup::current()) return group->take(std::move(*this));
  close();
  replace_target(false);
}

fs::path AtomicFile::name_on_this_system() const {
  return platform::name_while_open(file_);
}

fs::path AtomicFile::name_anywhere() {
  give_name();
  return fs::absolute(temporary_);
}

void AtomicFile::give_name() {
  if (!nameless_) return;
  std::error_code failure;
  do {
    choose_temporary_name();
    platform::give_name(file_, temporary_, failure);
  } while (failure == std::errc::file_exists);
  if (failure) fail(target_, failure);
  nameless_ = false;
}

void AtomicFile::close() {
  if (file_ == nullptr) return;
  give_name();
  if (std::fclose(std::exchange(file_, nullptr)) != 0) fail_by_errno(target_);
}

void AtomicFile::replace_target(bool keep_old) {
  std::error_code failure;
  if (keep_old && fs::is_regular_file(target_, failure)) {
    // By a second name, so that the first shows a whole file at any time. Some file systems give no
    // file two names.
    fs::path old = temporary_.string() + ".old";
    fs::create_hard_link(target_, old, failure);
    if (failure) fs::rename(target_, old, failure);
    if (failure) fail(target_, failure);
    old_ = std::move(old);
  }
  fs::rename(temporary_, target_, failure);
  if (failure) fail(target_, failure);
  temporary_.clear();
  in_place_ = true;
}

void AtomicFile::put_back() noexcept {
  std::error_code ignored;
  if (!old_.empty()) {
    fs::rename(old_, target_, ignored);
    remove_old();  // rename() leaves two names of one file as they are
  } else if (in_place_) {
    fs::remove(target_, ignored);
  }
  in_place_ = false;
}

void AtomicFile::remove_old() noexcept {
  std::error_code ignored;
  if (!old_.empty()) fs::remove(old_, ignored);
  old_.clear();
}

OutputGroup *OutputGroup::current_group = nullptr;

OutputGroup::OutputGroup() {
  if (current_group != nullptr) throw std::logic_error("there is an OutputGroup already");
  current_group = this;
  platform::raise_open_file_limit();  // every file without a name stays open
}

OutputGroup::~OutputGroup() {
  current_group = nullptr;
  files_.clear();
  std::error_code ignored;
  std::for_each(folders_.rbegin(), folders_.rend(),
                [&](const fs::path &folder) { fs::remove(folder, ignored); });
}

fs::path OutputGroup::place_of(const fs::path &folder) const {
  if (std::ranges::find(new_folders_, folder / "") == new_folders_.end()) return folder;
  fs::path place = folder;
  std::error_code failure;
  while (place.has_parent_path() && !fs::exists(place, failure)) place = place.parent_path();
  return fs::exists(place, failure) ? place : fs::path(".");
}

void OutputGroup::make_folders(const fs::path &folder) {
  fs::path made;
  for (const fs::path &part : folder) {
    made /= part;
    std::error_code failure;
    if (fs::exists(made, failure)) continue;
    folders_.push_back(made);
    if (!fs::create_directory(made, failure)) folders_.pop_back();
    if (failure) throw Error("cannot make the folder {}: {}", folder.string(), failure.message());
  }
}

void OutputGroup::take(AtomicFile &&file) {
  files_.push_back(std::unique_ptr<AtomicFile>(new AtomicFile(std::move(file))));
  // A system with few open files keeps some for the files at work.
  if (platform::is_near_open_file_limit(files_.back()->file_)) files_.back()->close();
}

void OutputGroup::commit() {
  try {
    for (const fs::path &folder : new_folders_) make_folders(folder);
    for (const auto &file : files_) file->close();
    const bool alone = files_.size() == 1;
    for (const auto &file : files_) file->replace_target(!alone);
  } catch (...) {
    std::for_each(files_.rbegin(), files_.rend(), [](const auto &file) { file->put_back(); });
    throw;
  }
  for (const auto &file : files_) file->remove_old();
  files_.clear();
  folders_.clear();
}

std::uint64_t OutputGroup::bytes_of(const fs::path &path) const {
  for (const auto &file : files_) {
    if (file->target_ != follow_links(path)) continue;
    return file->file_ != nullptr ? platform::size_of(file->file_)
                                  : fs::file_size(file->temporary_);
  }
  return fs::file_size(path);
}

}  // namespace isowave::core
