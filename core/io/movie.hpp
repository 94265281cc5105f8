#pragma once
// Movies: pictures, encoded by the program ffmpeg.

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <optional>

#include "core/io/atomic_file.hpp"
#include "core/io/png.hpp"
#include "core/platform/child_process.hpp"

namespace isowave::core {

/// Throws  Error: the name is not one of MP4 files; frames a second are not 0.1 to 1000; H.264
/// cannot have such a size; there is no program ffmpeg
void check_movie(const std::filesystem::path &path, std::uint32_t width, std::uint32_t height,
                 double fps);

/// Writes an MP4 file (H.264, yuv420p, BT.709, without sound) that appears whole or not at all, as
/// an AtomicFile.
class Movie {
 public:
  /// Starts ffmpeg.
  ///
  /// Throws  Error: as check_movie(); the file cannot be written
  Movie(const std::filesystem::path &path, std::uint32_t width, std::uint32_t height, double fps);

  /// Appends a frame, and waits until ffmpeg has taken it.
  ///
  /// image   RGB, of the movie's size
  /// Throws  Error: ffmpeg has failed; std::invalid_argument: another size
  void write(const Image8 &image);
  std::size_t num_frames() const { return num_frames_; }

  /// Waits for ffmpeg and gives the file its name. Call once, nothing may follow.
  ///
  /// Throws  Error: ffmpeg has failed, or there is no frame
  void commit();

 private:
  /// Throws  Error: what ffmpeg said, or its exit status
  [[noreturn]] void fail(int status) const;

  std::uint32_t width_, height_;
  std::size_t num_frames_ = 0;
  AtomicFile file_;
  std::optional<platform::ChildProcess> ffmpeg_;
};

}  // namespace isowave::core
