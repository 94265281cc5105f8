#include "isowave/series.hpp"

#include <algorithm>
#include <iterator>
#include <utility>

#include "core/api/guarded.hpp"
#include "core/api/volume_implementation.hpp"
#include "core/sources/series.hpp"

namespace isowave {

using core::guarded;

struct Series::Implementation {
  Implementation(const std::vector<core::SeriesStep> &steps, const Compression &compression,
                 const RawFile &raw)
      : series(steps, to_overrides(raw), storage_of(steps, compression)),
        grid(public_grid(series.info())) {}

  /// Throws  core::Error: compression is asked for, and a file is compressed already
  static core::Storage storage_of(const std::vector<core::SeriesStep> &steps,
                                  const Compression &compression) {
    core::Storage storage;
    for (const core::SeriesStep &step : steps) storage = storage_for(step.path, compression);
    return storage;
  }

  core::Series series;
  Grid grid;
};

Series::Series(const std::filesystem::path &path, const Compression &compression,
               const RawFile &raw)
    : Series(std::vector{path}, compression, raw) {}
Series::Series(const std::vector<std::filesystem::path> &paths, const Compression &compression,
               const RawFile &raw)
    : implementation_(guarded("opening a series", [&] {
        std::vector<std::string> names;
        std::ranges::transform(paths, std::back_inserter(names),
                               [](const auto &path) { return path.string(); });
        return std::make_unique<Implementation>(core::steps_of_files(names), compression, raw);
      })) {}
Series::~Series() = default;
Series::Series(Series &&) noexcept = default;
Series &Series::operator=(Series &&) noexcept = default;

std::size_t Series::size() const {
  return implementation_->series.size();
}
std::string Series::name(std::size_t step) const {
  return guarded("naming a step", [&] { return implementation_->series.step(step).what(); });
}
const Grid &Series::grid() const {
  return implementation_->grid;
}
const std::vector<std::string> &Series::notices() const {
  return implementation_->series.notices();
}

std::shared_ptr<const Volume> Series::open(std::size_t step) {
  return guarded("opening a volume", [&] {
    return std::make_shared<const Volume>(std::make_unique<const Volume::Implementation>(
        implementation_->series.open(step), std::vector<std::string>{}));
  });
}
void Series::prepare(std::size_t step) {
  guarded("opening a volume", [&] { implementation_->series.prepare(step); });
}

}  // namespace isowave
