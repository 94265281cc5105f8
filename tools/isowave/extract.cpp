// isowave extract: an isosurface as a file of triangles.

#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>

#include "core/base/error.hpp"
#include "core/base/parallel_for.hpp"
#include "core/base/text.hpp"
#include "core/extract/extractor.hpp"
#include "core/io/atomic_file.hpp"
#include "core/io/file_name.hpp"
#include "core/mesh/host_extractor.hpp"
#include "core/mesh/mesh_changes.hpp"
#include "core/mesh/mesh_file.hpp"
#include "core/view/detail.hpp"
#include "core/zfp/describe_compression.hpp"
#include "core/zfp/isovalue.hpp"
#include "tools/isowave/commands.hpp"
#include "tools/isowave/compile_report.hpp"
#include "tools/isowave/device_choice.hpp"
#include "tools/isowave/help_groups.hpp"
#include "tools/isowave/outputs.hpp"
#include "tools/isowave/program.hpp"
#include "tools/isowave/render_stats.hpp"
#include "tools/isowave/renderer_options.hpp"
#include "tools/isowave/strict_options.hpp"
#include "tools/isowave/volume_options.hpp"

namespace isowave::core::tools {

namespace {

struct ExtractArgs {
  std::string input, output, device, stats;
  VolumeOptions volume;
  CompressionOptions compression;
  std::optional<double> isovalue;
  std::uint32_t level = 0;
  std::string normals = "smooth", vertices = "apart", stream = "auto";
  ExtractorOptions extractor;
  MeshChanges changes;
  bool isovalue_suggested = false;
};

std::string default_output(const ExtractArgs &options) {
  const std::string stem = volume_stem(options.input);
  return options.isovalue ? fmt::format("{}_iso{}.ply", stem, *options.isovalue) : stem + ".ply";
}

const CompressedVolume &level_of(const CompressedVolume &volume, std::uint32_t level) {
  const std::vector<const CompressedVolume *> levels = levels_of(volume, true);
  if (level >= levels.size())
    throw Error("--level {}: the volume has {}, and 0 is the finest", level, levels.size());
  return *levels[level];
}

/// Counts what it hands on.
class Counted : public MeshSink {
 public:
  explicit Counted(MeshSink &inner) : inner_(inner) {}
  void begin(const MeshSize &of_mesh) override { inner_.begin(of_mesh); }
  void add(const MeshPart &part) override {
    size.num_vertices += part.vertices.size();
    size.num_triangles += part.triangles.size();
    inner_.add(part);
  }

  MeshSize size;

 private:
  MeshSink &inner_;
};

/// What extracts: a device, or if that is null the host; what it did.
struct Extraction {
  std::unique_ptr<ocl::Device> device{};
  ExtractStats on_device{};
  HostExtractStats on_host{};

  bool is_on_host() const { return device == nullptr; }
  double total_ms() const { return is_on_host() ? on_host.total_ms : on_device.total_ms; }
  std::uint64_t decoded_blocks() const {
    return is_on_host() ? on_host.decoded_blocks : on_device.decoded_blocks;
  }
};

/// What did it, and how.
void add_statistics(nlohmann::ordered_json &document, const Extraction &done) {
  if (done.is_on_host()) {
    document.update({{"listed_blocks", done.on_host.listed_blocks},
                     {"decoded_blocks", done.on_host.decoded_blocks},
                     {"total_ms", done.on_host.total_ms}});
    return;
  }
  const ExtractStats &stats = done.on_device;
  document.update({{"listed_blocks", stats.listed_blocks},
                   {"needed_blocks", stats.needed_blocks},
                   {"decoded_blocks", stats.decoded_blocks},
                   {"cache_slots", stats.cache_slots},
                   {"count_batches", stats.count_batches},
                   {"write_batches", stats.write_batches},
                   {"list_ms", stats.list_ms},
                   {"count_ms", stats.count_ms},
                   {"write_ms", stats.write_ms},
                   {"total_ms", stats.total_ms},
                   {"memory", memory_json(done.device->ledger())}});
}

nlohmann::ordered_json stats_json(const ExtractArgs &options, const CompressedVolume &volume,
                                  const Extraction &done, const MeshSize &written,
                                  const SimplifiedMesh &simplified) {
  const glm::uvec3 dims = volume.info.dims;
  nlohmann::ordered_json document = {{"program", program_name()}};
  if (done.is_on_host()) {
    document["host"] = {{"threads", thread_count(0)}, {"memory", done.on_host.memory_bytes}};
  } else {
    document["device"] = device_json(done.device->info());
  }
  document.update({{"volume",
                    {{"file", options.input},
                     {"dims", {dims.x, dims.y, dims.z}},
                     {"compression", compression_mode(volume)},
                     {"rate", volume.rate()},
                     {"max_voxel_error", volume.max_voxel_error
                                             ? nlohmann::ordered_json(*volume.max_voxel_error)
                                             : nlohmann::ordered_json()}}},
                   {"isovalue", *options.isovalue},
                   {"isovalue_suggested", options.isovalue_suggested},
                   {"level", options.level},
                   {"normals", options.normals},
                   {"vertex_places", options.vertices},
                   {"closed", options.changes.closed},
                   {"largest", options.changes.largest},
                   {"simplify", options.changes.simplify},
                   {"simplify_error", simplified.error},
                   {"vertices", written.num_vertices},
                   {"triangles", written.num_triangles}});
  add_statistics(document, done);
  return document;
}

void check_outputs(const ExtractArgs &options) {
  mesh_format_of(options.output);  // or throws
  Outputs outputs;
  outputs.read_volume(options.input);
  outputs.write("--output", options.output);
  outputs.write("--stats", options.stats);
  check_json_name(options.stats);
}

/// If no isovalue was given: takes a suggested one, also for the name of the output.
void suggest_isovalue(ExtractArgs &options, const CompressedVolume &volume, bool names_output) {
  if (options.isovalue) return;
  options.isovalue = suggested_isovalue(volume);
  options.isovalue_suggested = true;
  if (!names_output) return;
  options.output = default_output(options);
  check_outputs(options);
}

/// Extracts the surface, changed as the options say, to `written`.
SimplifiedMesh extract_changed(const ExtractArgs &options, const CompressedVolume &volume,
                               const CompressedVolume &level, Extraction &done, MeshSink &written) {
  const float isovalue = drawn_isovalue(volume, *options.isovalue);
  const ExtractorOptions &wanted = options.extractor;
  return give_changed(
      level, isovalue, wanted.vertices, options.changes, written, [&](MeshSink &sink) {
        const Progress progress = make_progress_bar("extracting");
        if (done.is_on_host()) {
          done.on_host = extract_on_host(level, isovalue,
                                         {.with_normals = wanted.with_normals,
                                          .vertices = wanted.vertices,
                                          .memory_limit = wanted.memory_budget},
                                         sink, progress);
        } else {
          done.on_device = Extractor(*done.device, level, wanted).extract(isovalue, sink, progress);
        }
      });
}

void print_summary(const ExtractArgs &options, const Extraction &done, const MeshSize &written,
                   const SimplifiedMesh &simplified) {
  fmt::print("isovalue {}: {} {}, {} {}; {} {} decoded, {:.1f} ms\n", *options.isovalue,
             with_commas(written.num_vertices), plural(written.num_vertices, "vertex", "vertices"),
             with_commas(written.num_triangles),
             plural(written.num_triangles, "triangle", "triangles"),
             with_commas(done.decoded_blocks()), plural(done.decoded_blocks(), "block", "blocks"),
             done.total_ms());
  if (options.changes.simplify < 1) fmt::print("{}\n", describe(simplified));
}

void run_extract(const CLI::App &command, ExtractArgs options) {
  const bool names_output = options.output.empty();
  if (names_output) options.output = default_output(options);
  check_outputs(options);
  options.extractor.with_normals = options.normals == "smooth";
  options.extractor.vertices =
      options.vertices == "apart" ? VertexPlaces::kApart : VertexPlaces::kExact;
  options.extractor.stream = stream_place_from_string(options.stream);
  check_changes(options.changes, options.extractor.vertices);
  if (options.level > 0) want_levels(options.compression);

  Extraction done;
  const ocl::DrawsOn chosen =
      choose_device_or_host(options.device, first_given(command, {"--cache-slots", "--stream"}));
  std::optional<CompileReport> compiling;
  const auto open_device = [&] {
    done.device = open_and_say(ocl::choose_device(options.device));
    compiling.emplace(*done.device);
  };
  if (chosen == ocl::DrawsOn::kDevice) open_device();
  const CompressedVolume volume = load_volume(options.input, to_overrides(options.volume),
                                              options.compression, done.device.get());
  print_compression(options.input, volume);
  suggest_isovalue(options, volume, names_output);
  const CompressedVolume &level = level_of(volume, options.level);
  if (chosen == ocl::DrawsOn::kHostByDefault &&
      !fits_host_extractor(level.info, options.extractor.memory_budget) &&
      !ocl::list_devices().empty())
    open_device();
  if (done.is_on_host()) say_host();
  MeshFile file(options.output);
  Counted written(file);
  const SimplifiedMesh simplified = extract_changed(options, volume, level, done, written);
  if (compiling) compiling->finish();
  file.commit(make_progress_bar("writing"));
  print_summary(options, done, written.size, simplified);
  warn_of_isovalue(volume, *options.isovalue);
  if (const std::string notice = file.notice(); !notice.empty()) warn(notice);
  const double memory =
      done.is_on_host() ? double(done.on_host.memory_bytes) : double(done.device->ledger().peak());
  fmt::print("wrote {}: {} bytes; {} {:.1f} MiB{}\n", one_line(options.output),
             with_commas(OutputGroup::current()->bytes_of(options.output)),
             done.is_on_host() ? "host memory:" : "device memory: peak", memory / (1 << 20),
             names_output ? "; --output names another file" : "");
  if (!options.stats.empty())
    write_json(stats_json(options, level, done, written.size, simplified), options.stats);
}

}  // namespace

void add_extract(CLI::App &app) {
  const auto options = std::make_shared<ExtractArgs>();
  CLI::App *command =
      app.add_subcommand("extract", "Write an isosurface as triangles: PLY, STL, OBJ, VTP, glTF");
  command->add_option("VOLUME", options->input, "a .zfp file, or " + std::string(kVolumeHelp))
      ->required();
  command
      ->add_option("-i,--isovalue", options->isovalue,
                   "value of the field on the surface [the first that `isowave info` suggests]")
      ->check(fits_float32());
  command->add_option(
      "--output,-o", options->output,
      "file that ends in .ply, .stl, .obj, .vtp, .gltf or .glb; coordinates are in the "
      "volume's world [VOLUME_isoV.ply in the current folder]");
  command
      ->add_option("--level", options->level,
                   "level of detail: 0 is the volume itself, each further level halves the voxels "
                   "along each axis")
      ->capture_default_str();
  command
      ->add_option(
          "--normals", options->normals,
          "normals of vertices: smooth (central differences of voxels), or none, which needs fewer "
          "blocks")
      ->check(CLI::IsMember({"smooth", "none"}))
      ->capture_default_str();
  command
      ->add_option(
          "--vertices", options->vertices,
          "places of vertices: apart (at least 1/1024 of an edge away from voxels, so that "
          "every triangle has an area) or exact (at the isovalue, even on a voxel)")
      ->check(CLI::IsMember({"apart", "exact"}))
      ->capture_default_str();
  command->add_flag("--closed", options->changes.closed,
                    "closes the surface by flat caps in the faces of the volume's box, as printers "
                    "want it");
  command
      ->add_option(
          "--largest", options->changes.largest,
          "number of parts of the surface that are kept, those with the largest areas [all]")
      ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 32));
  command
      ->add_option("--simplify", options->changes.simplify,
                   "share of the triangles that is left, above 0, up to 1; prints the error. This "
                   "and --largest hold the whole surface in memory [1]")
      ->check(CLI::Range(1e-9, 1.0));
  command->add_option("--device", options->device,
                      "host: this program extracts, without OpenCL; or an OpenCL device: index, "
                      "cpu, gpu, or a part of its name (see `isowave devices`) [ISOWAVE_DEVICE, or "
                      "the first GPU, or the host]");
  add_volume_options(*command, options->volume);
  add_compression_options(*command, options->compression);
  command
      ->add_option("--memory-budget", options->extractor.memory_budget,
                   "bound on the buffers that are made on the device, e.g. 600MB (1000^2) or 1GiB "
                   "(1024^3); a surface that needs more is extracted in batches [3/4 of the "
                   "device's memory]; on the host, on value ranges and decoded blocks [1/4 of its "
                   "memory]")
      ->transform(byte_count())
      ->type_name("BYTES");
  command
      ->add_option("--cache-slots", options->extractor.cache_slots,
                   "most decoded blocks on the device, 17 to 2^26, without normals 8 to 2^26 [as "
                   "many as the surface needs]")
      ->check(CLI::Range(8u, 1u << 26));
  command
      ->add_option("--stream", options->stream,
                   "place of the compressed volume: device, host (blocks are uploaded on request), "
                   "or auto (the device, if that leaves a quarter of the budget)")
      ->check(CLI::IsMember({"auto", "device", "host"}))
      ->capture_default_str();
  command->add_option("--stats", options->stats,
                      "file for JSON statistics: blocks, batches, times, memory");
  group_options(*command, "Options of every day",
                {"--help", "--isovalue", "--output", "--level", "--normals", "--vertices",
                 "--closed", "--largest", "--simplify", "--device", "--stats"});
  group_volume_options(*command);
  group_compression_options(*command);
  group_options(*command, "Memory", {"--memory-budget", "--cache-slots", "--stream"});
  command->callback([options, command] { run_extract(*command, *options); });
}

}  // namespace isowave::core::tools
