#pragma once
// What the fuzz targets share: files that exist in memory only, what must hold of errors and
// volumes, and packing.
//
// A target is an LLVMFuzzerTestOneInput(): it gives one input to a reader as a user's file would
// come. Whatever is not an Error of one line, or not what the target demands of an accepted file,
// ends the process.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <string_view>

extern "C" {
int LLVMFuzzerTestOneInput(const std::uint8_t *data, std::size_t size);
std::size_t LLVMFuzzerCustomMutator(std::uint8_t *data, std::size_t size, std::size_t max_size,
                                    unsigned seed);
/// libFuzzer's own: changes an input in place and returns its new size, at least 1.
std::size_t LLVMFuzzerMutate(std::uint8_t *data, std::size_t size, std::size_t max_size);
}

namespace isowave::core::fuzz {

/// Ends the process, with `what` as the last line on stderr, unless `holds`.
void demand(bool holds, std::string_view what);

/// This process's own folder among the temporary files, removed at exit. ISOWAVE_FUZZ_KEEP names
/// another, which stays, and has refusals printed: to look at a single input.
const std::filesystem::path &folder();
/// Replaces a file in folder().
std::filesystem::path put(const std::string &name, std::string_view bytes);
std::string bytes_of(const std::filesystem::path &path);

/// Runs read() and returns whether it was through. An Error that it throws must be one short line
/// without control characters; nothing else may be thrown.
bool accepts(const std::function<void()> &read);

/// Opens the volume and reads all its voxels, in pieces of several layers and once more layer by
/// layer: refused, or both times the same.
void read_volume(const std::filesystem::path &path);

bool same_bits(std::span<const float> a, std::span<const float> b);

/// The formats of one compressed file, as zlib counts its window's bits.
enum class Packing { kGzip = 15 + 16, kZlib = 15 };
std::string pack(std::string_view bytes, Packing packing);
/// The first `limit` bytes of what a compressed file holds, as far as it can be unpacked.
std::string unpack(std::string_view packed, std::size_t limit);
std::uint32_t crc_of(std::string_view bytes, std::uint32_t crc = 0);

/// Data behind the header that begins an input may be packed by the target, since hardly any change
/// to a compressed file leaves one. The input's first byte says how: 'g' gzip, 'z' zlib, others:
/// not at all.
std::string pack_by(char how, std::string_view bytes);

/// LLVMFuzzerMutate() of a string, to at most max_size bytes.
void mutate(std::string &bytes, std::size_t max_size);
/// Writes a mutator's result over its input, if it fits; returns its size, or leaves the work to
/// LLVMFuzzerMutate().
std::size_t replace(std::string_view bytes, std::uint8_t *data, std::size_t size,
                    std::size_t max_size);

inline std::string_view text_of(const std::uint8_t *data, std::size_t size) {
  return {reinterpret_cast<const char *>(data), size};
}

}  // namespace isowave::core::fuzz
