#pragma once
// Pages that show a volume in any browser, without a server and without a network.

#include <filesystem>
#include <memory>
#include <string>

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
  /// Size of the picture that is seen until the engine has drawn one, and without JavaScript.
  ImageSize poster{1280, 720};
};

/// Writes a page: one HTML file that holds the engine, the volume, the scene and a picture. It
/// draws what the library draws, with the same bits, in the browser, and asks no server. Readers
/// can turn the scene and change it. The compressed volume takes 4/3 of its bytes.
///
/// scene   its volume is not opened. Without a camera, the surfaces fill the picture
/// path    ends in .html; the file appears when it is complete
/// Throws  Error: no engine; a scene with what pages do not show: annotations, a parallel view, a
///         transparent background, a second volume, tables of colours, surfaces that are not
///         clipped or mapped, more than eight clipping planes; a volume of more than 350 MiB; the
///         file cannot be written
void save_page(const std::shared_ptr<const Volume> &volume, const Scene &scene,
               const std::filesystem::path &path, const PageOptions &options = {});
/// Throws  Error: what save_page() refuses, whatever the volume is
void check_page(const Scene &scene, const std::filesystem::path &path,
                const PageOptions &options = {});

}  // namespace isowave
