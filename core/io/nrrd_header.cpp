#include "core/io/nrrd_header.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "core/base/error.hpp"
#include "core/base/text.hpp"
#include "core/io/text_header.hpp"

namespace isowave::core {

namespace {

constexpr double kUnknown = std::numeric_limits<double>::quiet_NaN();

constexpr std::array<std::string_view, 30> kNrrdFields{"content",
                                                       "number",
                                                       "type",
                                                       "block size",
                                                       "dimension",
                                                       "space",
                                                       "space dimension",
                                                       "sizes",
                                                       "spacings",
                                                       "thicknesses",
                                                       "axis mins",
                                                       "axis maxs",
                                                       "centers",
                                                       "space directions",
                                                       "kinds",
                                                       "labels",
                                                       "units",
                                                       "min",
                                                       "max",
                                                       "old min",
                                                       "old max",
                                                       "endian",
                                                       "encoding",
                                                       "line skip",
                                                       "byte skip",
                                                       "data file",
                                                       "space origin",
                                                       "space units",
                                                       "sample units",
                                                       "measurement frame"};

/// The field's name as in kNrrdFields; empty if the format has no such field. Case does not matter,
/// nor do blanks.
std::string_view field_name(std::string_view text) {
  const auto squeeze = [](std::string_view name) {
    std::string result = lower_case(name);
    std::erase(result, ' ');
    return result;
  };
  std::string wanted = squeeze(text);
  if (wanted == "centerings") wanted = "centers";
  for (const std::string_view name : kNrrdFields) {
    if (squeeze(name) == wanted) return name;
  }
  return {};
}

void check_nrrd_magic(HeaderLines &lines, const std::string &what) {
  constexpr std::array<std::string_view, 6> kMagics{"NRRD00.01", "NRRD0001", "NRRD0002",
                                                    "NRRD0003",  "NRRD0004", "NRRD0005"};
  if (!lines.next() || !lines.line().starts_with("NRRD")) throw Error("{}: not an NRRD file", what);
  if (std::find(kMagics.begin(), kMagics.end(), lines.line()) == kMagics.end()) {
    throw Error("{}: {} is not a version of NRRD that is supported: use NRRD0001 to NRRD0005", what,
                quote(lines.line()));
  }
}

/// Reads up to the empty line after which voxels begin, or to the end of the file. Returns whether
/// the line was there.
///
/// files  gets the names of data files, if there are several
bool read_nrrd_fields(HeaderLines &lines, const std::string &what, HeaderFields &fields,
                      std::optional<VoxelFileNames> &files) {
  check_nrrd_magic(lines, what);
  while (lines.next()) {
    const std::string_view line = lines.line();
    if (line.empty()) return true;
    if (line.starts_with('#')) continue;
    const std::size_t colon = line.find(": ");
    const std::string_view name =
        colon == line.npos ? std::string_view() : field_name(line.substr(0, colon));
    if (!name.empty()) {
      if (lines.is_cut()) throw Error("{}: broken header: '{}' is too long", what, name);
      fields.add(name, trim(line.substr(colon + 2)));
      if (name == "data file") files = read_voxel_file_names(fields, name, lines);
      if (files && !files->list.empty()) return false;  // a list ends the header
    } else if (line.find(":=") == line.npos) {
      throw Error("{}: broken header: line {}, {}, is neither a field of NRRD nor a key/value pair",
                  what, lines.number(), quote(line));
    }
  }
  return false;
}

VoxelType nrrd_voxel_type(const HeaderFields &fields) {
  struct Names {
    VoxelType type;
    std::array<std::string_view, 8> names;
  };
  constexpr std::array<Names, 10> kTypes{
      {{VoxelType::kInt8, {"signed char", "int8", "int8_t"}},
       {VoxelType::kUint8, {"uchar", "unsigned char", "uint8", "uint8_t"}},
       {VoxelType::kInt16,
        {"short", "short int", "signed short", "signed short int", "int16", "int16_t"}},
       {VoxelType::kUint16,
        {"ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"}},
       {VoxelType::kInt32, {"int", "signed int", "int32", "int32_t"}},
       {VoxelType::kUint32, {"uint", "unsigned int", "uint32", "uint32_t"}},
       {VoxelType::kInt64,
        {"longlong", "long long", "long long int", "signed long long", "signed long long int",
         "int64", "int64_t"}},
       {VoxelType::kUint64,
        {"ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"}},
       {VoxelType::kFloat32, {"float"}},
       {VoxelType::kFloat64, {"double"}}}};
  const std::string wanted = lower_case(fields["type"]);
  for (const Names &candidate : kTypes) {
    const auto found = std::find(candidate.names.begin(), candidate.names.end(), wanted);
    if (found != candidate.names.end() && !wanted.empty()) return candidate.type;
  }
  fields.fail("type", "not supported: need an integer, float or double");
}

/// Vectors of three numbers like (1,0,0.5), or `none`, for which (nan,nan,nan) stands, too.
std::vector<std::optional<glm::dvec3>> parse_vectors(const HeaderFields &fields,
                                                     std::string_view name) {
  constexpr std::string_view kNoVector = "none";
  std::vector<std::optional<glm::dvec3>> vectors;
  std::string_view text = fields[name];
  while (!(text = trim(text)).empty()) {
    if (text.starts_with(kNoVector) &&
        (text.size() == kNoVector.size() || text[kNoVector.size()] == ' ' ||
         text[kNoVector.size()] == '\t')) {
      vectors.emplace_back();
      text.remove_prefix(kNoVector.size());
      continue;
    }
    const std::size_t end = text.find(')');
    if (text.front() != '(' || end == text.npos)
      fields.fail(name, "need vectors like (1,0,0), or none");
    std::string_view inside = text.substr(1, end - 1);
    glm::dvec3 vector(0.0);
    for (int i = 0; i < 3; ++i) {
      const std::size_t comma = i < 2 ? inside.find(',') : inside.size();
      const std::optional<double> value =
          comma == inside.npos ? std::nullopt : parse_number(trim(inside.substr(0, comma)));
      if (!value || std::isinf(*value)) fields.fail(name, "need vectors of 3 finite numbers");
      vector[i] = *value;
      inside.remove_prefix(std::min(comma + 1, inside.size()));
    }
    const bool is_none = std::isnan(vector.x) && std::isnan(vector.y) && std::isnan(vector.z);
    if (!is_none && (std::isnan(vector.x) || std::isnan(vector.y) || std::isnan(vector.z)))
      fields.fail(name, "need vectors of 3 finite numbers, or of 3 nan for none");
    vectors.push_back(is_none ? std::nullopt : std::optional(vector));
    text.remove_prefix(end + 1);
  }
  return vectors;
}

/// `count` texts in quotes, which may have \" in them.
std::vector<std::string> parse_quoted(const HeaderFields &fields, std::string_view name,
                                      std::size_t count) {
  std::string_view text = fields[name];
  std::vector<std::string> found;
  while (!(text = trim(text)).empty()) {
    std::size_t end = 1;
    while (end < text.size() && text[end] != '"') end += text[end] == '\\' ? 2 : 1;
    if (text.front() != '"' || end >= text.size()) fields.fail(name, "need texts in quotes");
    found.emplace_back(text.substr(1, end - 1));
    text.remove_prefix(end + 1);
  }
  if (found.size() != count) fields.fail(name, fmt::format("need {} texts in quotes", count));
  return found;
}

struct NrrdAxis {
  std::int64_t size = 0;
  double spacing = kUnknown, min = kUnknown, max = kUnknown;
  bool is_cell_centered = true;
  std::string kind = "???", unit;
  std::optional<glm::dvec3> direction;

  /// Whether a last axis counts volumes, rather than values of a voxel.
  bool can_be_steps() const { return is_domain() || kind == "list"; }
  /// Along which one may resample; else the values of a voxel.
  bool is_domain() const {
    return kind == "domain" || kind == "space" || kind == "time" || kind == "???" || kind == "none";
  }
};

std::vector<NrrdAxis> read_nrrd_axes(const HeaderFields &fields) {
  constexpr std::int64_t kMaxAxes = 16;
  const std::int64_t dimension = fields.integer("dimension");
  if (dimension < 1 || dimension > kMaxAxes) fields.fail("dimension", "must be 1 to 16");
  const std::size_t count(dimension);
  std::vector<NrrdAxis> axes(count);
  const std::vector<std::int64_t> sizes = fields.integers("sizes", count);
  for (std::size_t i = 0; i < count; ++i) {
    if (sizes[i] < 1 || sizes[i] > kMaxDim)
      fields.fail("sizes", fmt::format("each must be 1 to {}", kMaxDim));
    axes[i].size = sizes[i];
  }
  const auto read_numbers = [&](std::string_view name, double NrrdAxis::*member) {
    if (!fields.has(name)) return;
    const std::vector<double> values = fields.numbers(name, count, HeaderFields::Nan::kUnknown);
    for (std::size_t i = 0; i < count; ++i) axes[i].*member = values[i];
  };
  read_numbers("spacings", &NrrdAxis::spacing);
  read_numbers("axis mins", &NrrdAxis::min);
  read_numbers("axis maxs", &NrrdAxis::max);
  if (fields.has("thicknesses")) fields.numbers("thicknesses", count, HeaderFields::Nan::kUnknown);
  if (fields.has("centers")) {
    const std::vector<std::string_view> words = fields.words("centers", count);
    for (std::size_t i = 0; i < count; ++i) {
      const std::string word = lower_case(words[i]);
      if (word != "cell" && word != "node" && word != "???" && word != "none")
        fields.fail("centers", "must be cell or node");
      axes[i].is_cell_centered = word != "node";
    }
  }
  if (fields.has("kinds")) {
    const std::vector<std::string_view> words = fields.words("kinds", count);
    for (std::size_t i = 0; i < count; ++i) axes[i].kind = lower_case(words[i]);
  }
  if (fields.has("labels")) parse_quoted(fields, "labels", count);
  if (fields.has("units")) {
    const std::vector<std::string> units = parse_quoted(fields, "units", count);
    for (std::size_t i = 0; i < count; ++i) axes[i].unit = units[i];
  }
  return axes;
}

struct NrrdSpace {
  std::string_view name{}, short_name{};
  glm::dvec3 to_lps{1.0};  ///< factors that turn coordinates of the file's space into LPS
  bool is_anatomical = false;
};

/// Empty if the file has no space.
std::optional<NrrdSpace> read_nrrd_space(const HeaderFields &fields) {
  const std::array<NrrdSpace, 6> spaces{{{"right-anterior-superior", "ras", {-1, -1, 1}, true},
                                         {"left-anterior-superior", "las", {1, -1, 1}, true},
                                         {"left-posterior-superior", "lps", {1, 1, 1}, true},
                                         {"scanner-xyz", "", {1, 1, 1}},
                                         {"3d-right-handed", "", {1, 1, 1}},
                                         {"3d-left-handed", "", {1, 1, 1}}}};
  if (!fields.has("space")) {
    if (!fields.has("space dimension")) return std::nullopt;
    if (fields.integer("space dimension") != 3)
      fields.fail("space dimension", "not supported: need 3");
    return NrrdSpace{};
  }
  if (fields.has("space dimension")) fields.fail("space dimension", "given beside 'space'");
  const std::string wanted = lower_case(fields["space"]);
  for (const NrrdSpace &space : spaces) {
    if (!wanted.empty() && (wanted == space.name || wanted == space.short_name)) return space;
  }
  fields.fail("space", "not supported: need one of 3 dimensions");
}

/// The three axes of the volume. All others must have size 1, but for the last: if it is a fourth
/// one, it is that of steps.
std::vector<NrrdAxis> volume_axes(const HeaderFields &fields, std::vector<NrrdAxis> axes,
                                  const std::string &what, std::uint32_t &num_steps) {
  const bool by_direction = fields.has("space directions");
  if (by_direction) {
    const auto directions = parse_vectors(fields, "space directions");
    if (directions.size() != axes.size())
      fields.fail("space directions", fmt::format("need {} of them", axes.size()));
    for (std::size_t i = 0; i < axes.size(); ++i) axes[i].direction = directions[i];
  }
  std::vector<NrrdAxis> chosen;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    const NrrdAxis &axis = axes[i];
    const bool is_last = i + 1 == axes.size();
    if (by_direction ? axis.direction.has_value() : axis.is_domain() && chosen.size() < 3) {
      if (!axis.is_domain())
        fields.fail("kinds", "an axis that has a space direction must be a domain or space");
      chosen.push_back(axis);
    } else if (is_last && chosen.size() == 3 && axis.can_be_steps()) {
      num_steps = std::uint32_t(axis.size);
    } else if (axis.size != 1) {
      if (!axis.is_domain()) throw Error("{}: {} components per voxel, need 1", what, axis.size);
      throw Error("{}: an image of {} {}, need a volume of 3", what, axes.size(),
                  plural(axes.size(), "axis", "axes"));
    }
  }
  if (chosen.size() != 3)
    throw Error("{}: an image of {} {}, need a volume of 3", what, axes.size(),
                plural(axes.size(), "axis", "axes"));
  return chosen;
}

void set_geometry_in_space(const HeaderFields &fields, const std::vector<NrrdAxis> &axes,
                           const NrrdSpace &space, const std::string &what, VolumeHeader &header) {
  VolumeInfo &info = header.info;
  info.is_anatomical = space.is_anatomical;
  const glm::dvec3 &to_lps = space.to_lps;
  glm::dvec3 unit(1.0);  // of the space's axes
  if (fields.has("space units")) {
    const std::vector<std::string> names = parse_quoted(fields, "space units", 3);
    const std::vector<double> millimetres = millimetres_in(names, "space units", what, header);
    unit = {millimetres[0], millimetres[1], millimetres[2]};
  }
  for (int i = 0; i < 3; ++i) {
    const NrrdAxis &axis = axes[std::size_t(i)];
    if (!std::isnan(axis.spacing))
      fields.fail("spacings", "not with a space: its 'space directions' say them");
    if (!std::isnan(axis.min))
      fields.fail("axis mins", "not with a space: its 'space origin' says them");
    if (!std::isnan(axis.max))
      fields.fail("axis maxs", "not with a space: its 'space origin' says them");
    if (!axis.direction) continue;  // no axis has one: a unit grid
    const glm::dvec3 step = *axis.direction * unit;
    const double length = glm::length(step);
    set_axis(info, i, length, step * (1.0 / length) * to_lps);
  }
  if (fields.has("space origin")) {
    const auto origin = parse_vectors(fields, "space origin");
    if (origin.size() != 1) fields.fail("space origin", "need one vector");
    if (origin[0]) info.origin = *origin[0] * unit * to_lps + 0.0;
  }
  if (fields.has("measurement frame") && parse_vectors(fields, "measurement frame").size() != 3) {
    fields.fail("measurement frame", "need 3 vectors");
  }
}

/// Spacing from the field or from where the axis begins and ends; the first sample lies at its
/// beginning or, where samples are cells, half a spacing further.
void set_geometry_by_axes(const HeaderFields &fields, const std::vector<NrrdAxis> &axes,
                          const std::string &what, VolumeHeader &header) {
  for (const std::string_view name :
       {"space directions", "space origin", "measurement frame", "space units"}) {
    if (fields.has(name)) fields.fail(name, "needs 'space' or 'space dimension'");
  }
  VolumeInfo &info = header.info;
  const std::array<std::string, 3> names{axes[0].unit, axes[1].unit, axes[2].unit};
  const std::vector<double> millimetres = millimetres_in(names, "units", what, header);
  for (int i = 0; i < 3; ++i) {
    const NrrdAxis &axis = axes[std::size_t(i)];
    const double unit = millimetres[std::size_t(i)];
    double spacing = axis.spacing;
    if (std::isnan(spacing) && !std::isnan(axis.min) && !std::isnan(axis.max)) {
      spacing = (axis.max - axis.min) / double(axis.is_cell_centered ? axis.size : axis.size - 1);
    }
    glm::dvec3 direction(0.0);
    direction[i] = 1.0;
    set_axis(info, i, std::isnan(spacing) ? 1.0 : spacing * unit, direction);
    if (!std::isnan(axis.min) && !std::isnan(spacing)) {
      info.origin[i] = (axis.min + (axis.is_cell_centered ? spacing / 2 : 0.0)) * unit;
    }
  }
}

VoxelEncoding nrrd_encoding(const HeaderFields &fields) {
  const std::string name = lower_case(fields["encoding"]);
  if (name == "raw") return VoxelEncoding::kRaw;
  if (name == "gzip" || name == "gz") return VoxelEncoding::kGzip;
  if (name == "hex") return VoxelEncoding::kHex;
  if (name == "ascii" || name == "text" || name == "txt") return VoxelEncoding::kText;
  fields.fail("encoding", "not supported: use raw, gzip, hex or ascii");
}

/// line skip and byte skip: the lines of the file as it is, the bytes of the data as it is
/// unpacked.
void set_nrrd_skips(const HeaderFields &fields, VoxelLayout &voxels) {
  if (fields.has("line skip")) {
    const std::int64_t lines = fields.integer("line skip");
    if (lines < 0) fields.fail("line skip", "must not be negative");
    voxels.lines_to_skip = std::uint64_t(lines);
  }
  if (!fields.has("byte skip")) return;
  const std::int64_t bytes = fields.integer("byte skip");
  voxels.from_end = bytes == -1 && voxels.encoding == VoxelEncoding::kRaw;
  if (bytes >= 0) {
    voxels.bytes_to_skip = std::uint64_t(bytes);
  } else if (!voxels.from_end) {
    fields.fail("byte skip", "must be 0 or more, or with raw voxels -1");
  }
}

void set_nrrd_byte_order(const HeaderFields &fields, VoxelLayout &voxels) {
  if (fields.has("endian")) {
    const std::string name = lower_case(fields["endian"]);
    if (name != "little" && name != "big") fields.fail("endian", "must be little or big");
    voxels.big_endian = name == "big";
  } else if (size_of(voxels.type) > 1 && voxels.encoding != VoxelEncoding::kText) {
    static_cast<void>(fields["endian"]);  // fails: it is missing
  }
}

void check_other_nrrd_fields(const HeaderFields &fields, std::uint64_t num_voxels) {
  for (const std::string_view name : {"min", "max", "old min", "old max"}) {
    if (fields.has(name)) fields.numbers(name, 1, HeaderFields::Nan::kUnknown);
  }
  if (fields.has("number") && fields.integer("number") != std::int64_t(num_voxels)) {
    fields.fail("number", "not the product of the sizes");
  }
  if (fields.has("block size")) fields.fail("block size", "blocks are not supported");
}

}  // namespace

VolumeHeader read_nrrd_header(const std::shared_ptr<const InputFile> &file) {
  const std::string &what = file->what();
  HeaderLines lines(file);
  HeaderFields fields(what);
  std::optional<VoxelFileNames> files;
  const bool has_end = read_nrrd_fields(lines, what, fields, files);

  VolumeHeader header;
  std::uint32_t num_steps = 1;
  const std::vector<NrrdAxis> all_axes = read_nrrd_axes(fields);
  const std::vector<NrrdAxis> axes = volume_axes(fields, all_axes, what, num_steps);
  for (int i = 0; i < 3; ++i) header.info.dims[i] = std::uint32_t(axes[std::size_t(i)].size);
  if (const std::optional<NrrdSpace> space = read_nrrd_space(fields)) {
    set_geometry_in_space(fields, axes, *space, what, header);
  } else {
    set_geometry_by_axes(fields, axes, what, header);
  }
  check_other_nrrd_fields(fields, header.info.num_voxels() * num_steps);

  VoxelLayout &voxels = header.voxels;
  header.info.type = voxels.type = nrrd_voxel_type(fields);
  voxels.num_steps = num_steps;
  voxels.encoding = nrrd_encoding(fields);
  set_nrrd_byte_order(fields, voxels);
  set_nrrd_skips(fields, voxels);
  if (files) {
    std::vector<std::int64_t> sizes(all_axes.size());
    std::ranges::transform(all_axes, sizes.begin(), &NrrdAxis::size);
    voxels.file = file;
    voxels.files = std::make_shared<const VoxelFiles>(file, std::move(*files), sizes, "data file");
  } else if (fields.has("data file")) {
    voxels.file = open_data_file(*file, fields["data file"]);
  } else {
    if (!has_end)
      throw Error("{}: broken header: no empty line after it, and no 'data file'", what);
    voxels.file = file;
    voxels.offset = lines.end();
  }
  return header;
}

}  // namespace isowave::core
