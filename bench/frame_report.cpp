#include "bench/frame_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "bench/run_info.hpp"
#include "tools/isowave/renderer_options.hpp"

namespace isowave::core::bench {

namespace {

using nlohmann::ordered_json;

/// A value of every frame of the list.
template <class Value>
std::vector<double> each(const std::vector<TimedFrame> &frames, const Value &value) {
  std::vector<double> values(frames.size());
  std::transform(frames.begin(), frames.end(), values.begin(), value);
  return values;
}

/// Sum of one of the counts over a frame's passes.
double sum_of(const FrameStats &frame, uint PassCounts::*count) {
  double sum = 0;
  for (const PassStats &pass : frame.passes) sum += pass.counts.*count;
  return sum;
}

/// Median N_Spec of the passes in which rays looked ahead.
double median_n_spec(const FrameStats &frame) {
  std::vector<double> counts;
  for (const PassStats &pass : frame.passes) {
    if (pass.n_spec > 0) counts.push_back(pass.n_spec);
  }
  return counts.empty() ? 0.0 : median(std::move(counts));
}

/// NaN where they are not counted.
double sum_of_visible(const FrameStats &frame) {
  double sum = 0;
  for (const PassStats &pass : frame.passes)
    sum += pass.visible_blocks ? *pass.visible_blocks : std::numeric_limits<double>::quiet_NaN();
  return sum;
}

/// "-" for NaN.
std::string cell_text(double value, int precision) {
  return std::isnan(value) ? "-" : fmt::format("{:.{}f}", value, precision);
}

double mean_utilization(const FrameStats &frame) {
  double sum = 0;
  for (const PassStats &pass : frame.passes) sum += pass.utilization_percent;
  return frame.passes.empty() ? 0.0 : sum / num_passes(frame);
}

/// A column of the table that is not a total time: of a cold frame.
struct Column {
  const char *name;
  const char *json_name;
  int precision;
  double (*value)(const FrameReport &report, const FrameStats &frame);
};

const Column kColumns[] = {
    {"hit %", "rays_hit_percent", 1,
     [](const FrameReport &report, const FrameStats &frame) {
       return 100.0 * double(frame.rays_hit) / double(report.options.size.num_rays());
     }},
    {"passes", "passes", 0,
     [](const FrameReport &, const FrameStats &frame) { return num_passes(frame); }},
    {"ms/pass", "ms_per_pass", 2,
     [](const FrameReport &, const FrameStats &frame) {
       return frame.total_ms / num_passes(frame);
     }},
    {"visible %", "visible_blocks_percent", 2,
     [](const FrameReport &report, const FrameStats &frame) {
       return 100.0 * sum_of_visible(frame) / double(report.grid.block_count());
     }},
    {"decoded", "decoded_blocks", 0,
     [](const FrameReport &, const FrameStats &frame) {
       return sum_of(frame, &PassCounts::decoded_count);
     }},
    {"nrm blocks", "normals_decoded_blocks", 0,
     [](const FrameReport &, const FrameStats &frame) {
       return double(frame.normals.decoded_blocks);
     }},
    {"nrm passes", "normals_passes", 0,
     [](const FrameReport &, const FrameStats &frame) { return double(frame.normals.passes); }},
    {"nrm ms", "normals_ms", 2,
     [](const FrameReport &, const FrameStats &frame) { return frame.normals.ms; }},
    {"N_spec", "median_n_spec", 1,
     [](const FrameReport &, const FrameStats &frame) { return median_n_spec(frame); }},
    {"util %", "utilization_percent", 1,
     [](const FrameReport &, const FrameStats &frame) { return mean_utilization(frame); }},
};

/// The medians over a view's rounds.
double column_of(const FrameReport &report, const ViewTimes &view, const Column &column) {
  return median(
      each(view.cold, [&](const FrameStats &frame) { return column.value(report, frame); }));
}

/// How many times the floor a kind of frame takes, of the medians.
double over_floor(const FloorTimes &floor, const std::vector<ViewTimes> &views, FramesOfView kind) {
  return median(all_times(views, kind, hits_ms)) / median(floor.all());
}

void print_row(const std::string &name, const std::vector<std::string> &cells) {
  fmt::print("{:<7}", name);
  for (std::size_t i = 0; i < cells.size(); ++i) {
    fmt::print(" {:>{}}", cells[i], i < 2 * std::size(kKinds) ? 23 : 10);
  }
  fmt::print("\n");
}

void print_views(const FrameReport &report) {
  std::vector<std::string> header;
  for (const auto &[kind, member] : kKinds) {
    header.push_back(fmt::format("{} ms", kind));
    header.push_back(fmt::format("{}, hits", kind));
  }
  for (const Column &column : kColumns) header.emplace_back(column.name);
  print_row("view", header);
  std::vector<std::vector<double>> columns(std::size(kColumns));
  for (std::size_t v = 0; v < report.views.size(); ++v) {
    const ViewTimes &view = report.views[v];
    std::vector<std::string> cells;
    for (const auto &[kind, member] : kKinds) {
      for (const auto ms : {arrays_ms, hits_ms})
        cells.push_back(spread_text(spread_of(each(view.*member, ms))));
    }
    for (std::size_t c = 0; c < columns.size(); ++c) {
      columns[c].push_back(column_of(report, view, kColumns[c]));
      cells.push_back(cell_text(columns[c].back(), kColumns[c].precision));
    }
    print_row(std::to_string(v), cells);
  }
  std::vector<std::string> cells;
  for (const auto &[kind, member] : kKinds) {
    for (const auto ms : {arrays_ms, hits_ms})
      cells.push_back(spread_text(spread_of(all_times(report.views, member, ms))));
  }
  for (std::size_t c = 0; c < columns.size(); ++c) {
    cells.push_back(cell_text(median(columns[c]), kColumns[c].precision));
  }
  print_row("median", cells);
}

/// Stage -> its times in every view that has it, 0 where it was not run.
std::map<std::string, std::vector<double>> times_by_stage(const FrameReport &report) {
  std::set<std::string> names;
  for (const auto &view : report.stage_ms) {
    for (const auto &[stage, ms] : view) names.insert(stage);
  }
  std::map<std::string, std::vector<double>> times;
  for (const auto &view : report.stage_ms) {
    for (const std::string &name : names)
      times[name].push_back(view.contains(name) ? view.at(name) : 0.0);
  }
  return times;
}

void print_stages(const FrameReport &report) {
  const auto times = times_by_stage(report);
  std::vector<std::pair<double, std::string>> rows;
  double sum = 0;
  for (const auto &[stage, ms] : times) {
    rows.emplace_back(median(ms), stage);
    sum += rows.back().first;
  }
  std::sort(rows.rbegin(), rows.rend());
  fmt::print(
      "\nms per stage of a cold frame, medians over the views, from a run with profiling ({}):\n",
      report.stage_clock);
  for (const auto &[ms, stage] : rows)
    fmt::print("  {:<14}{:>9.2f}{:>7.1f} %\n", stage, ms, 100 * ms / sum);
  fmt::print("  {:<14}{:>9.2f}\n", "sum", sum);
}

ordered_json frame_json(const FrameReport &report, const TimedFrame &frame) {
  ordered_json json = {{"total_ms", frame.arrays_ms}, {"hits_ms", frame.total_ms}};
  for (const Column &column : kColumns) json[column.json_name] = column.value(report, frame);
  return json;
}

}  // namespace

std::string spread_text(const Spread &spread) {
  const int precision = spread.median < 100 ? 2 : 1;
  return fmt::format("{:.{}f} ({:.{}f}..{:.{}f})", spread.median, precision, spread.min, precision,
                     spread.max, precision);
}

void print_run(const FrameReport &report) {
  const glm::uvec3 dims = report.grid.info.dims;
  fmt::print("{}\n", report.command);
  for (const auto &[name, value] : report.run_info) fmt::print("  {:<16}{}\n", name, value);
  fmt::print("  {:<16}{} x {} x {} {}, {} blocks, rate {}, isovalue {}\n", "volume", dims.x, dims.y,
             dims.z, to_string(report.grid.info.type), report.grid.block_count(),
             report.grid.rate(), report.isovalue);
  const ImageSize &size = report.options.size;
  fmt::print("  {:<16}{} x {}, {} rays a pixel, {} views, {} rounds, N_spec up to {}\n", "frames",
             size.width, size.height, size.samples * size.samples, report.num_views, report.rounds,
             report.options.max_speculation);
}

void print_floor(const FrameReport &report, const std::vector<ViewTimes> &views) {
  if (!report.floor) return;
  if (report.floor->ms.empty()) {
    fmt::print("resident floor not measured: {}\n", report.floor->why_not);
    return;
  }
  fmt::print("resident floor {} ms:", spread_text(spread_of(report.floor->all())));
  for (const auto &[kind, member] : kKinds)
    fmt::print(" {} is {:.2f} times that{}", kind, over_floor(*report.floor, views, member),
               member == &ViewTimes::next ? "\n" : ",");
}

ordered_json floor_json(const FrameReport &report, const std::vector<ViewTimes> &views) {
  if (!report.floor || report.floor->ms.empty()) return nullptr;
  ordered_json json = spread_json(spread_of(report.floor->all()));
  for (const auto &[kind, member] : kKinds)
    json["over_floor"][kind] = over_floor(*report.floor, views, member);
  json["frames"] = report.floor->ms;
  return json;
}

ordered_json options_json(const FrameReport &report) {
  nlohmann::ordered_json json = {
      {"volume", report.volume},
      {"dims", {report.grid.info.dims.x, report.grid.info.dims.y, report.grid.info.dims.z}},
      {"type", to_string(report.grid.info.type)},
      {"blocks", report.grid.block_count()},
      {"rate", report.grid.rate()},
      {"isovalue", report.isovalue},
      {"width", report.options.size.width},
      {"height", report.options.size.height},
      {"samples", report.options.size.samples},
      {"views", report.num_views},
      {"rounds", report.rounds}};
  json.update(tools::renderer_options_json(report.options));
  json["voxel_pixels"] = report.voxel_pixels;
  json["normals"] = to_string(report.normals);
  json["ambient"] = report.ambient_rays;
  json["shadow"] = report.shadow_rays;
  json["bounce"] = report.bounce_rays;
  json["slices"] = report.slices.planes.size();
  json["has_field"] = report.light.color_by_field.has_value();
  json["depth"] = report.wanted.depth;
  json["clipping_planes"] = report.clip.planes.size();
  for (const SurfaceStyle &surface : report.surfaces)
    json["surfaces"].push_back({surface.isovalue_of_field(), surface.opacity});
  return json;
}

void print_report(const FrameReport &report) {
  print_run(report);
  fmt::print("  {:<16}{} slots\n", "cache", report.options.cache_slots);
  fmt::print("  {:<16}{:.1f} MiB at most; setup {:.0f} ms\n\n", "device memory",
             double(report.peak_bytes) / (1 << 20), report.setup_ms);
  print_views(report);
  print_floor(report, report.views);
  fmt::print(
      "Times are wall clock, median (min..max) over the rounds, and in the last row over views and "
      "rounds:\n"
      "until {} in the host's memory, and until hits are on the device.\n"
      "cold: nothing decoded before; warm: the same view again; next: then one degree further. The "
      "other\n"
      "columns are a cold frame's. visible: blocks with rays, summed over the passes, of all "
      "blocks; decoded:\n"
      "blocks; nrm blocks, nrm passes: those for smooth normals, on top; nrm ms: theirs, of the "
      "frame;\n"
      "N_spec: median over the passes; util: intersected ray-block pairs per pass, of all pixels. "
      "resident\nfloor: the whole volume decoded, one kernel, no cache.\n",
      report.wanted.depth ? "picture and depth are" : "the picture is");
  print_stages(report);
}

ordered_json to_json(const FrameReport &report) {
  ordered_json json = {
      {"program", "frame_bench"}, {"command", report.command}, {"date", utc_now()}};
  for (const auto &[name, value] : report.run_info) json["context"][name] = value;
  json["options"] = options_json(report);
  for (const auto &[kind, member] : kKinds) {
    json["total_ms"][kind] = spread_json(spread_of(all_times(report.views, member, arrays_ms)));
    json["hits_ms"][kind] = spread_json(spread_of(all_times(report.views, member, hits_ms)));
  }
  for (const Column &column : kColumns) {
    std::vector<double> values;
    for (const ViewTimes &view : report.views) values.push_back(column_of(report, view, column));
    json["median"][column.json_name] = median(values);
  }
  json["resident_floor"] = floor_json(report, report.views);
  json["stage_clock"] = report.stage_clock;
  for (const auto &[stage, ms] : times_by_stage(report))
    json["stage_ms"][stage] = spread_json(spread_of(ms));
  json["setup_ms"] = report.setup_ms;
  json["memory"] = report.memory;
  for (const ViewTimes &view : report.views) {
    ordered_json frames;
    for (const auto &[kind, member] : kKinds) {
      for (const TimedFrame &frame : view.*member)
        frames[kind].push_back(frame_json(report, frame));
    }
    json["frames"].push_back(std::move(frames));
  }
  return json;
}

}  // namespace isowave::core::bench
