#include "core/io/movie.hpp"

#include <fmt/format.h>

#include <span>
#include <stdexcept>
#include <string>
#include <system_error>
#include <vector>

#include "core/base/error.hpp"
#include "core/io/file_name.hpp"

namespace isowave::core {

namespace fs = std::filesystem;

namespace {

fs::path find_ffmpeg(const fs::path &path) {
  fs::path program = platform::find_program("ffmpeg");
  if (program.empty())
    throw Error(
        "{}: movies need the program ffmpeg, which is not in PATH: install it, or write pictures "
        "with numbers in their names",
        path.string());
  return program;
}

/// The last line of a text that is not empty.
std::string last_line(const std::string &text) {
  const std::size_t end = text.find_last_not_of("\r\n ");
  if (end == text.npos) return {};
  const std::size_t before = text.find_last_of("\r\n", end);
  const std::size_t begin = before == text.npos ? 0 : before + 1;
  return text.substr(begin, end + 1 - begin);
}

}  // namespace

void check_movie(const fs::path &path, std::uint32_t width, std::uint32_t height, double fps) {
  check_ending(path, "movies are written as MP4", {".mp4"});
  if (!(fps >= 0.1 && fps <= 1000)) throw Error("{} frames a second: give 0.1 to 1000", fps);
  if (width % 2 != 0 || height % 2 != 0)
    throw Error("{}: a movie of {}x{} pixels: H.264 needs an even width and height", path.string(),
                width, height);
  find_ffmpeg(path);
}

Movie::Movie(const fs::path &path, std::uint32_t width, std::uint32_t height, double fps)
    : width_(width), height_(height), file_(path) {
  check_movie(path, width, height, fps);
  std::vector<std::string> arguments{"-nostdin", "-hide_banner", "-loglevel",
                                     "error",    "-xerror",      "-y"};
  const auto add = [&](std::initializer_list<std::string> more) {
    arguments.insert(arguments.end(), more);
  };
  add({"-f", "rawvideo", "-pix_fmt", "rgb24", "-video_size", fmt::format("{}x{}", width, height),
       "-framerate", fmt::format("{}", fps), "-i", "pipe:0"});
  add({"-an", "-c:v", "libx264", "-crf", "18", "-vf",
       "scale=out_color_matrix=bt709:out_range=tv,format=yuv420p", "-colorspace", "bt709",
       "-color_primaries", "bt709", "-color_trc", "iec61966-2-1", "-color_range", "tv"});
  add({"-movflags", "+faststart", "-f", "mp4", "file:" + file_.name_on_this_system().string()});
  std::error_code failure;
  ffmpeg_.emplace(find_ffmpeg(path), arguments, failure);
  if (failure) throw Error("{}: cannot start ffmpeg: {}", path.string(), failure.message());
}

void Movie::write(const Image8 &image) {
  if (image.width != width_ || image.height != height_ || image.channels != 3)
    throw std::invalid_argument("Movie::write: not the movie's size, or not RGB");
  std::error_code failure;
  ffmpeg_->write(std::as_bytes(std::span(image.pixels)), failure);
  if (failure) fail(ffmpeg_->finish());
  num_frames_ += 1;
}

void Movie::commit() {
  if (num_frames_ == 0) throw Error("{}: a movie without a frame", file_.target().string());
  // A full disk is an error that ffmpeg 5.1 tells, and yet it ends with status 0.
  if (const int status = ffmpeg_->finish(); status != 0 || !ffmpeg_->errors().empty()) fail(status);
  file_.commit();
}

void Movie::fail(int status) const {
  const std::string said = last_line(ffmpeg_->errors());
  throw Error("{}: ffmpeg failed: {}", file_.target().string(),
              said.empty() ? fmt::format("its exit status is {}", status) : said);
}

}  // namespace isowave::core
