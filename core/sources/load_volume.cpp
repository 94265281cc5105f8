#include "core/sources/load_volume.hpp"

#include <array>
#include <cmath>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/raw_reader.hpp"
#include "core/view/frame.hpp"
#include "core/zfp/isovalue.hpp"
#include "core/zfp/zfp_accuracy.hpp"

namespace isowave::core {

namespace {

GenerateOptions parse_generator(std::string_view text) {
  const auto fail = [&] {
    throw Error("'{}{}': write generate:FIELD_XxYxZ_TYPE or generate:FIELD_XxYxZ_TYPE:SEED",
                kGenerate, text);
  };
  const std::size_t colon = text.find(':');
  const std::optional<RawName> name = parse_raw_name(text.substr(0, colon));
  if (!name) fail();
  GenerateOptions options;
  options.field = field_from_string(name->name);
  options.dims = name->dims;
  options.type = name->type;
  if (colon != std::string_view::npos) {
    const auto seed = parse_all<decltype(options.seed)>(text.substr(colon + 1));
    if (!seed) fail();
    options.seed = *seed;
    if (!has_seed(options.field))
      throw Error("'{}{}': a seed is of noise, and {} has none: leave it out", kGenerate, text,
                  name->name);
  }
  return options;
}

/// Gives a generated volume the spacing asked for.
class RespacedReader : public VolumeReader {
 public:
  RespacedReader(std::unique_ptr<VolumeReader> source, const glm::dvec3 &spacing)
      : source_(std::move(source)) {
    info_ = source_->info();
    info_.spacing = spacing;
  }
  void read_layers(std::uint32_t z_begin, std::uint32_t num_layers, std::span<float> out) override {
    source_->read_layers(z_begin, num_layers, out);
  }
  void read_exact_layers(std::uint32_t z_begin, std::uint32_t num_layers,
                         std::span<double> out) override {
    source_->read_exact_layers(z_begin, num_layers, out);
  }
  DeviceVoxels *on_device() override { return source_->on_device(); }

 private:
  std::unique_ptr<VolumeReader> source_;
};

Progress step(const Storage &storage, std::string_view name) {
  return storage.progress ? storage.progress(name) : Progress{};
}

/// [min, max] of the source's voxels, from which a relative tolerance follows.
double absolute_tolerance(const OpenReader &open, std::string_view what, const Storage &storage,
                          InputOptions input) {
  ChunkCoder nothing;
  input.progress = step(storage, "reading the value range");
  const std::array<double, 2> range = read_in_chunks(*open(), input, nothing).source;
  if (range[0] == range[1]) {
    throw Error("{}: all voxels are {}: there is no range that an error is relative to", what,
                range[0]);
  }
  const double tolerance = *storage.tolerance_relative * (range[1] - range[0]);
  if (!(tolerance > 0 && std::isfinite(tolerance))) {
    throw Error(
        "a relative tolerance of {}: of values from {} to {}, that is {}: need above 0 and finite",
        *storage.tolerance_relative, range[0], range[1], tolerance);
  }
  return tolerance;
}

}  // namespace

std::optional<BlockPrecision> find_precision(const OpenReader &open, std::string_view what,
                                             const Storage &storage) {
  if (storage.rate) return {};
  const auto check = [](const char *name, const std::optional<double> &tolerance) {
    if (tolerance && !(*tolerance > 0))
      throw Error("a {} of {}: must be above 0", name, *tolerance);
  };
  check("tolerance", storage.tolerance);
  check("relative tolerance", storage.tolerance_relative);
  InputOptions input{storage.map_nan, storage.no_data, {}, storage.num_threads, storage.part};
  ErrorGoal goal{storage.tolerance, storage.exact};
  if (storage.tolerance_relative) goal.tolerance = absolute_tolerance(open, what, storage, input);
  input.progress = step(storage, "measuring errors");
  return choose_precision(*open(), goal, input);
}

namespace {

/// Finds the precision, which may read the whole volume.
CompressOptions compress_options(const OpenReader &open, const VolumeInfo &info,
                                 std::string_view what, const Storage &storage) {
  check_drawable(info, what);
  CompressOptions options;
  options.rate = storage.rate.value_or(0);
  options.precision = find_precision(open, what, storage);
  options.levels = storage.levels;
  options.measure_error = storage.measure_error;
  options.input = {storage.map_nan, storage.no_data, step(storage, "compressing"),
                   storage.num_threads};
  if (!options.precision) options.encoder = storage.encoder;
  return options;
}

}  // namespace

CompressedVolume compress_volume(const OpenReader &open, std::string_view what,
                                 const Storage &storage) {
  const std::unique_ptr<VolumeReader> reader = open();
  CompressedVolume volume =
      compress(*reader, compress_options(open, reader->info(), what, storage));
  if (const std::string notice = all_zero_notice(volume); !notice.empty())
    throw Error("{}: {}", what, notice);
  return volume;
}

CompressedVolume compress_volume_to_file(const OpenReader &open, std::string_view what,
                                         const Storage &storage,
                                         const std::filesystem::path &path) {
  check_zfp_name(path.string());
  const std::unique_ptr<VolumeReader> reader = open();
  compress_to_file(*reader, compress_options(open, reader->info(), what, storage), path);
  return open_compressed_volume(path.string(), {});
}

bool is_zfp_name(std::string_view path) {
  return path.ends_with(".zfp");
}

void check_zfp_name(std::string_view path) {
  if (!is_zfp_name(path))
    throw Error("{}: compressed volumes are opened by the ending .zfp: give it", path);
}

CompressedVolume open_compressed_volume(const std::string &path, const RawOverrides &overrides) {
  if (overrides.dims || overrides.type) throw Error("{}: dims and type are for raw files", path);
  check_has_step(path, overrides.step);
  VolumeInfo info = read_zfp_file_info(path).info;
  if (overrides.spacing) info.spacing = *overrides.spacing;
  check_volume_info(info, path);
  check_drawable(info, path);  // before an index of all blocks is built
  CompressedVolume volume = open_zfp_file(path);
  if (overrides.spacing) set_spacing(volume, *overrides.spacing);
  return volume;
}

std::unique_ptr<VolumeReader> open_any_volume(const std::string &path,
                                              const RawOverrides &overrides,
                                              const NoiseMaker &noise,
                                              std::optional<std::uint32_t> step) {
  if (!path.starts_with(kGenerate)) return open_volume(path, overrides, step);
  if (overrides.dims || overrides.type)
    throw Error("{}: it says dims and type itself: leave them out", path);
  check_has_step(path, overrides.step);
  GenerateOptions options = parse_generator(std::string_view(path).substr(kGenerate.size()));
  options.noise = noise;
  std::unique_ptr<VolumeReader> reader = open_generated(options);
  if (!overrides.spacing) return reader;
  return std::make_unique<RespacedReader>(std::move(reader), *overrides.spacing);
}

}  // namespace isowave::core
