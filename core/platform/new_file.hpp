#pragma once
// Files that get their name, their rights and their place when they are finished; which users may
// write to a folder.

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <string>
#include <system_error>

namespace isowave::core::platform {

/// Makes a file without a name in a folder, for reading and writing. The system removes it when the
/// process ends, unless give_name() has been called.
///
/// Returns  nullptr if it cannot, or if the system has no such files
std::FILE *make_nameless(const std::filesystem::path &folder);
/// Makes a file of that name, for reading and writing.
///
/// Returns  nullptr if it cannot: errc::file_exists if the name is taken
std::FILE *make_new(const std::filesystem::path &path, std::error_code &failure);
/// Gives a nameless file a name.
///
/// failure  errc::file_exists if the name is taken
void give_name(std::FILE *nameless, const std::filesystem::path &path, std::error_code &failure);
/// A name by which the processes of this system can open the file while this process has it open.
std::filesystem::path name_while_open(std::FILE *file);
/// Gives a new file the mode of the file that it will replace, and its owner, group and access list
/// as far as this user may. Does nothing if there is no such file.
void keep_permissions(const std::filesystem::path &replaced, std::FILE *file);
/// Part of keep_permissions(): the list of users and groups with rights of their own.
void copy_access_list(const std::filesystem::path &replaced, std::FILE *file);

/// Bytes that have come to the file: not those that wait in the stream.
std::uint64_t size_of(std::FILE *file);
/// The same text for all names of a file or folder that exists; "" and why if there is none.
std::string identity_of(const std::filesystem::path &path, std::error_code &failure);

/// Whether this user may write to a file.
bool can_write(const std::filesystem::path &file, std::error_code &failure);
/// Whether this user may make files in a folder, and reach them.
bool can_fill(const std::filesystem::path &folder, std::error_code &failure);
/// Whether this user may run a program.
bool can_run(const std::filesystem::path &program);

/// Lets this process have as many open files as the system allows it.
void raise_open_file_limit();
/// Whether a file that was just opened is one of the last that the process may have open.
bool is_near_open_file_limit(std::FILE *file);

}  // namespace isowave::core::platform
