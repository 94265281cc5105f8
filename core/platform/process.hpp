#pragma once
// This process: its numbers, its environment, its forks.

#include <cstdint>
#include <filesystem>
#include <optional>

namespace isowave::core::platform {

/// Number of the user whose rights this process has.
std::uint64_t user_id();
/// Number of this process among those of its system.
std::uint64_t process_id();
/// The user's home by the system's list of users, whatever the environment says.
std::optional<std::filesystem::path> home_by_list();

/// The file of the program that this process runs; empty if the system does not say.
std::filesystem::path own_program();
/// Has the arguments of main() in UTF-8. Windows gives main() others; elsewhere they stay as they
/// are.
void make_utf8(int &argc, char **&argv);

void set_environment(const char *name, const char *value);
void unset_environment(const char *name);

/// Has each process that is forked from this one call a function at its begin. It stays registered.
void call_in_forks(void (*call)());

/// Has the C library load what exceptions need while there is memory. Otherwise glibc loads its
/// unwinder when an exception first leaves one of its own functions, and aborts the process if it
/// cannot.
void load_unwinder();

}  // namespace isowave::core::platform
