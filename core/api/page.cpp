#include "isowave/page.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>
#include <string_view>
#include <system_error>
#include <vector>

#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/api/voxel_histogram.hpp"
#include "core/base/error.hpp"
#include "core/host/host_blocks.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/byte_source.hpp"
#include "core/io/file_name.hpp"
#include "core/platform/process.hpp"
#include "core/zfp/chunk_file.hpp"
#include "core/zfp/make_levels.hpp"
#include "core/zfp/zfp_file.hpp"
#include "isowave/host_renderer.hpp"

namespace isowave {

namespace {

namespace fs = std::filesystem;

/// Browsers have texts of up to 2^29 characters.
constexpr std::uint64_t kMostMebibytes = 350;
constexpr std::uint64_t kMostEngineBytes = 1u << 25;
constexpr std::size_t kMostPlanes = 8;  ///< as the viewer has it
constexpr const char *kEngineName = "page.html.gz";
constexpr const char *kSitePage = "index.html", *kSiteVolume = "volume.chunks";
/// What a site's page may do, too: read files beside it.
constexpr std::string_view kSiteConnect = " connect-src 'self';";
/// Places of the engine, seen from the program's folder: installed, built, in Python's package.
constexpr std::array kEngineFolders = {"../share/isowave", "wasm/install/share/isowave",
                                       "../wasm/install/share/isowave", ".."};

/// Writes bytes as base64 text.
class Base64Text {
 public:
  explicit Base64Text(core::AtomicFile &file) : file_(file) {}

  void write(std::span<const std::byte> bytes) {
    std::string text;
    for (const std::byte byte : bytes) {
      group_ = group_ << 8 | std::to_integer<std::uint32_t>(byte);
      if (++count_ == 3) add_group(text);
    }
    file_.write(text);
  }
  void finish() {
    const std::uint32_t missing = count_ == 0 ? 0 : 3 - count_;
    std::string text;
    for (; count_ != 0 && count_ < 3; ++count_) group_ <<= 8;
    if (count_ == 3) add_group(text);
    for (std::uint32_t i = 0; i < missing; ++i) text[text.size() - 1 - i] = '=';
    file_.write(text);
  }

 private:
  void add_group(std::string &text) {
    constexpr std::string_view kLetters =
        "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    for (int shift = 18; shift >= 0; shift -= 6) text += kLetters[group_ >> shift & 63];
    group_ = count_ = 0;
  }

  core::AtomicFile &file_;
  std::uint32_t group_ = 0, count_ = 0;
};

fs::path find_engine(const fs::path &wanted) {
  if (!wanted.empty()) return wanted;
  if (const char *const named = std::getenv("ISOWAVE_PAGE"); named != nullptr && *named != '\0')
    return named;
  const fs::path program = core::platform::own_program().parent_path();
  for (const char *folder : kEngineFolders) {
    const fs::path file = program / folder / kEngineName;
    std::error_code failure;
    if (!program.empty() && fs::is_regular_file(file, failure)) return file.lexically_normal();
  }
  throw core::Error(
      "pages need isowave's engine for browsers, which was not built: run tools/wasm, and name "
      "its share/isowave/{} by ISOWAVE_PAGE",
      kEngineName);
}

std::string read_engine(const fs::path &path) {
  core::InflateSource source({std::make_shared<core::InputFile>(path), 0}, core::Packing::kGzip);
  std::vector<std::byte> bytes(kMostEngineBytes);
  const std::size_t count = source.read(bytes);
  if (count == bytes.size()) throw core::Error("{}: no engine of a page", path.string());
  return {reinterpret_cast<const char *>(bytes.data()), count};
}

/// Throws  core::Error: what the viewer's page does not show
void check_for_page(const Scene &scene) {
  const auto refuse = [](bool has, const char *what) {
    if (has) throw core::Error("a page does not show {}: leave that out of the scene", what);
  };
  const Appearance &look = scene.appearance;
  const auto any = [&](auto is) { return std::ranges::any_of(scene.surfaces, is); };
  refuse(!look.color_table.empty() || !look.slice_table.empty(), "tables of colours");
  refuse(any([](const Surface &each) { return !each.clipped; }), "surfaces with clipped: false");
  refuse(any([](const Surface &each) { return !each.mapped; }), "surfaces with mapped: false");
  refuse(scene.clip.size() > kMostPlanes, "more than eight clipping planes");
}

/// The second volume of a scene; null: it has none.
///
/// Throws  core::Error: it is missing
std::shared_ptr<const Volume> second_volume(const Scene &scene, const PageOptions &options) {
  if (scene.field == "volume" || !scene.appearance.color_by_field) return {};
  if (!options.field)
    throw core::Error("the scene's colours are by a second volume (field), which was not opened");
  return options.field;
}

std::string title_of(const Scene &scene, const PageOptions &options) {
  const std::string title =
      options.title.empty() ? scene.volume.filename().string() : options.title;
  return title.empty() ? "Volume" : title;
}

/// The picture of a page's scene, which gets a camera if it has none.
///
/// field  null: the volume
std::vector<std::uint8_t> draw_poster(const std::shared_ptr<const Volume> &volume,
                                      const std::shared_ptr<const Volume> &field, Scene &scene,
                                      const PageOptions &options) {
  const ImageSize size = options.poster;
  Renderer renderer =
      make_host_renderer(volume, {.field = field ? field : volume, .largest = size});
  FrameRequest request = scene_request(scene);
  if (!scene.camera) scene.camera = request.camera = renderer.camera(scene.surfaces, size);
  request.size = size;
  request.appearance.transparent = false;  // as the page shows it
  Frame frame = renderer.render(request);
  if (scene.annotations && options.annotate && has_room_for_annotations(size)) {
    Annotations wanted = *scene.annotations;
    if (wanted.title.empty()) wanted.title = title_of(scene, options);
    const FrameStatistics &of = frame.statistics;
    options.annotate(frame, annotation_layout(wanted, request, of.color_range, of.slice_range));
  }
  return encode_png(frame);
}

/// For the text of an element or an attribute.
std::string to_html(const std::string &text) {
  std::string result;
  for (const char letter : text) {
    if (letter == '&' || letter == '<' || letter == '>' || letter == '"') {
      result += fmt::format("&#{};", static_cast<int>(letter));
    } else {
      result += letter;
    }
  }
  return result;
}

/// JSON that no browser takes for the end of its element.
std::string to_json_of_page(const std::string &json) {
  std::string result;
  for (const char letter : json) {
    if (letter == '<') {
      result += "\\u003c";
    } else {
      result += letter;
    }
  }
  return result;
}

constexpr std::array<std::string_view, 6> kPlaces = {"@ISOWAVE_CONNECT@", "@ISOWAVE_TITLE@",
                                                     "@ISOWAVE_POSTER@",  "@ISOWAVE_SCENE@",
                                                     "@ISOWAVE_VOLUME@",  "@ISOWAVE_FIELD@"};
/// The engine's text before, between and behind kPlaces.
using EngineParts = std::array<std::string, kPlaces.size() + 1>;

EngineParts read_parts(const fs::path &wanted) {
  const fs::path path = find_engine(wanted);
  const std::string engine = read_engine(path);
  EngineParts parts;
  std::size_t begin = 0;
  for (std::size_t i = 0; i < kPlaces.size(); ++i) {
    const std::size_t at = engine.find(kPlaces[i], begin);
    if (at == engine.npos) throw core::Error("{}: no engine of a page", path.string());
    parts[i] = engine.substr(begin, at - begin);
    begin = at + kPlaces[i].size();
  }
  parts.back() = engine.substr(begin);
  return parts;
}

/// Writes a page, and leaves it to the caller to commit its file.
///
/// connect       what the page's policy allows beside what all pages need
/// write_volume  writes what stands in the volume's place
/// write_field   and in that of the second one
template <class WriteVolume, class WriteField>
void write_page(const Scene &scene, core::AtomicFile &file, const PageOptions &options,
                std::span<const std::uint8_t> poster, std::string_view connect,
                const WriteVolume &write_volume, const WriteField &write_field) {
  const EngineParts parts = read_parts(options.engine);
  Scene shown = scene;
  shown.volume.clear();
  shown.dataset.clear();
  shown.index.clear();
  shown.field_dataset.clear();
  shown.field_index.clear();
  shown.field = scene.field.filename();
  if (shown.field.empty() && shown.appearance.color_by_field) shown.field = "field";

  file.write(parts[0]);
  file.write(connect);
  file.write(parts[1] + to_html(title_of(scene, options)) + parts[2]);
  Base64Text picture(file);
  picture.write(std::as_bytes(poster));
  picture.finish();
  file.write(parts[3] + to_json_of_page(scene_text(shown)) + parts[4]);
  write_volume();
  file.write(parts[5]);
  write_field();
  file.write(parts[6]);
}

/// Writes a volume as base64 text of a .zfp file.
void write_as_text(const Volume &volume, const fs::path &path, core::AtomicFile &file) {
  Base64Text bytes(file);
  core::give_zfp_file(volume.implementation().volume, path,
                      [&](std::span<const std::byte> piece) { bytes.write(piece); });
  bytes.finish();
}

/// Throws  core::Error: it is too large for a page
void check_size(const Volume &volume, const char *what) {
  const std::uint64_t mebibytes = volume.compressed_bytes() >> 20;
  if (mebibytes > kMostMebibytes)
    throw core::Error(
        "{} has {} MiB, and a page holds {}: compress it with a larger tolerance, or at a lower "
        "rate",
        what, mebibytes, kMostMebibytes);
}

/// Writes a volume in chunks, with all levels of detail that it can have.
core::ChunkFileSize write_site_volume(const core::CompressedVolume &volume,
                                      core::AtomicFile &file) {
  std::vector<core::CompressedVolume> made;
  if (volume.coarser_levels.empty()) made = core::make_levels(volume);
  std::vector<const core::CompressedVolume *> levels = {&volume};
  for (const core::CompressedVolume &level : made.empty() ? volume.coarser_levels : made)
    levels.push_back(&level);
  std::vector<core::MacrocellRanges> ranges;
  for (const core::CompressedVolume *level : levels) {
    const core::HostBlocks blocks(*level, core::HostBlocks::kNoLimit, 0);
    ranges.push_back(blocks.macrocell_ranges());
  }
  return core::write_chunks(levels, ranges, file);
}

/// A folder that is made if it is missing, and removed again unless it is to be kept. A group of
/// outputs makes its folders itself.
class NewFolder {
 public:
  explicit NewFolder(const fs::path &folder) : folder_(folder) {
    std::error_code failure;
    if (core::OutputGroup::current() != nullptr) return;
    is_new_ = fs::create_directory(folder, failure);
    if (failure)
      throw core::Error("cannot make the folder {}: {}", folder.string(), failure.message());
  }
  ~NewFolder() {
    std::error_code failure;
    if (is_new_) fs::remove(folder_, failure);
  }
  NewFolder(const NewFolder &) = delete;
  NewFolder &operator=(const NewFolder &) = delete;
  void keep() { is_new_ = false; }

 private:
  fs::path folder_;
  bool is_new_ = false;
};

/// What a site's page knows of its volume before it has asked for the file.
std::string text_of_site(const Volume &volume, const core::ChunkFileSize &size) {
  const VoxelHistogram values = voxel_histogram(volume);
  return nlohmann::json{{"file", kSiteVolume},           {"bytes", size.bytes},
                        {"head_bytes", size.head_bytes}, {"id", fmt::format("{:08x}", size.id)},
                        {"counts", values.counts},       {"range", values.range},
                        {"suggested", values.suggested}}
      .dump();
}

}  // namespace

void check_page(const Scene &scene, const fs::path &path, const PageOptions &options) {
  core::guarded("writing a page", [&] {
    core::check_ending(path, "pages are written as HTML", {".html", ".htm"});
    if (path.extension().empty())
      throw core::Error("{}: end the page's name in .html", path.string());
    check_for_page(scene);
    read_parts(options.engine);
  });
}

void save_page(const std::shared_ptr<const Volume> &volume, const Scene &scene,
               const fs::path &path, const PageOptions &options) {
  core::guarded("writing a page", [&] {
    if (!volume) throw core::Error("a page needs a volume");
    check_page(scene, path, options);
    const std::shared_ptr<const Volume> field = second_volume(scene, options);
    check_size(*volume, "the volume");
    if (field) check_size(*field, "the second volume");
    Scene shown = scene;
    const std::vector<std::uint8_t> poster = draw_poster(volume, field, shown, options);
    core::AtomicFile file(path);
    write_page(
        scene, file, options, poster, {}, [&] { write_as_text(*volume, path, file); },
        [&] {
          if (field) write_as_text(*field, path, file);
        });
    file.commit();
  });
}

std::array<fs::path, 2> site_files(const fs::path &folder) {
  return {folder / kSitePage, folder / kSiteVolume};
}

void check_site(const Scene &scene, const PageOptions &options) {
  core::guarded("writing a site", [&] {
    check_for_page(scene);
    if (scene.field != "volume" && scene.appearance.color_by_field)
      throw core::Error(
          "a site has one volume, and colours are by a second one (field): write a page, or leave "
          "that out of the scene");
    read_parts(options.engine);
  });
}

void save_site(const std::shared_ptr<const Volume> &volume, const Scene &scene,
               const fs::path &folder, const PageOptions &options) {
  core::guarded("writing a site", [&] {
    if (!volume) throw core::Error("a site needs a volume");
    check_site(scene, options);
    const auto [page, chunks] = site_files(folder);
    NewFolder new_folder(folder);
    Scene shown = scene;
    const std::vector<std::uint8_t> poster = draw_poster(volume, {}, shown, options);
    core::AtomicFile chunks_file(chunks), page_file(page);
    const core::ChunkFileSize size =
        write_site_volume(volume->implementation().volume, chunks_file);
    write_page(
        shown, page_file, options, poster, kSiteConnect,
        [&] { page_file.write(text_of_site(*volume, size)); }, [] {});
    chunks_file.commit();
    page_file.commit();
    new_folder.keep();
  });
}

}  // namespace isowave
