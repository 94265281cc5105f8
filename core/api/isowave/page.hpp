#pragma once
// Pages that show a volume in any browser: one file, without a server and without a network; or a
// folder for a server of static files, with a volume of any size.

#include <array>
#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "isowave/annotations.hpp"
#include "isowave/camera.hpp"
#include "isowave/scene.hpp"
#include "isowave/volume.hpp"

namespace isowave {

struct PageOptions {
  /// The engine, page.html.gz, which tools/wasm makes: isowave, compiled for browsers, and the
  /// viewer. Empty: the file that the environment variable ISOWAVE_PAGE names, or one that was
  /// built or installed with the program that calls this.
  std::filesystem::path engine{};
  std::string title{};  ///< of the page; empty: the name of the scene's volume
  /// The second volume, unless Scene::field is `volume` or colours are not by a field.
  std::shared_ptr<const Volume> field{};
  /// Size of the picture that is seen until the engine has drawn one, and without JavaScript.
  ImageSize poster{1280, 720};
  /// Draws annotations over that picture, in place; the library itself draws no letters. Called if
  /// the scene has annotations and the picture has room for them. Empty: the picture has none.
  std::function<void(Frame &frame, const std::vector<AnnotationGroup> &groups)> annotate{};
};

/// Writes a page: one HTML file that holds the engine, the volume, the scene and a picture. It
/// draws what the library draws, with the same bits, in the browser, and asks no server. Readers
/// can turn the scene and change it. Each compressed volume takes 4/3 of its bytes.
///
/// scene   its volumes are not opened. Without a camera, the surfaces fill the picture. The page
///         draws the annotations; PageOptions::annotate draws those of the picture
/// path    ends in .html; the file appears when it is complete
/// Throws  Error: no engine; a scene with what pages do not show: tables of colours, surfaces that
///         are not clipped or mapped, more than eight clipping planes; colours by a second volume
///         that is missing; a volume of more than 350 MiB; the file cannot be written
void save_page(const std::shared_ptr<const Volume> &volume, const Scene &scene,
               const std::filesystem::path &path, const PageOptions &options = {});
/// Throws  Error: what save_page() refuses, whatever the volume is
void check_page(const Scene &scene, const std::filesystem::path &path,
                const PageOptions &options = {});

/// Writes a site, which is two files: a page, index.html, and the volume, volume.chunks. The page
/// reads the parts of the volume that rays come to, by HTTP range requests. Any server of static
/// files that answers these can have the folder. The page draws with the same bits as that of
/// save_page(). Its first pictures are of coarser levels of detail, which are made if the volume
/// has none.
///
/// folder  is made if it is missing. Its two files appear when they are complete
/// Throws  Error: as save_page(), but a volume may have any size
void save_site(const std::shared_ptr<const Volume> &volume, const Scene &scene,
               const std::filesystem::path &folder, const PageOptions &options = {});
/// Throws  Error: what save_site() refuses, whatever the volume is
void check_site(const Scene &scene, const PageOptions &options = {});
/// The files that save_site() writes: page and volume.
std::array<std::filesystem::path, 2> site_files(const std::filesystem::path &folder);

}  // namespace isowave
