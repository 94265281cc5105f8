// Every voxel in a grid of NanoVDB. Its leaves are bricks of 8^3 voxels; leaves of one value are
// kept as one value.

#include <nanovdb/NanoVDB.h>
#include <nanovdb/util/GridBuilder.h>

#include <algorithm>
#include <cmath>
#include <mutex>
#include <utility>

#include "bench/gpu_peer/walked_side.cuh"

namespace isowave::core::bench {

namespace {

template <class Build>
struct NanoVoxels {
  const nanovdb::NanoGrid<Build> *grid;

  class Reader {
   public:
    PEER_BOTH explicit Reader(const NanoVoxels &voxels) : accessor_(*voxels.grid) {}
    PEER_BOTH void enter(const int cell[3]) {
      leaf_ = accessor_.probeLeaf(nanovdb::Coord(cell[0], cell[1], cell[2]));
    }
    PEER_BOTH float value(int x, int y, int z) const {
      return static_cast<float>(accessor_.getValue(nanovdb::Coord(x, y, z)));
    }
    /// Straight from the leaf; corners in other leaves through the accessor, leaf by leaf.
    PEER_BOTH void corners(const int cell[3], float f[8]) const {
      const int x = cell[0] & 7, y = cell[1] & 7, z = cell[2] & 7;
      if (leaf_ != nullptr && x < 7 && y < 7 && z < 7) {
        for (int i = 0; i < 8; ++i) f[i] = in_leaf(x << 6 | y << 3 | z, i);
      } else {
        border_corners(cell, f, std::make_integer_sequence<int, 8>{});
      }
    }

   private:
    /// Not a loop, since that is not unrolled: f would be in memory, and reads would wait for each
    /// other.
    template <int... kCorners>
    PEER_BOTH void border_corners(const int cell[3], float f[8],
                                  std::integer_sequence<int, kCorners...>) const {
      ((f[kCorners] = border_corner<kCorners>(cell)), ...);
    }
    template <int kCorner>
    PEER_BOTH float border_corner(const int cell[3]) const {
      constexpr int dx = kCorner >> 2, dy = kCorner >> 1 & 1, dz = kCorner & 1;
      const int x = cell[0] & 7, y = cell[1] & 7, z = cell[2] & 7;
      if (leaf_ != nullptr && x + dx < 8 && y + dy < 8 && z + dz < 8)
        return in_leaf(x << 6 | y << 3 | z, kCorner);
      return value(cell[0] + dx, cell[1] + dy, cell[2] + dz);
    }
    PEER_BOTH float in_leaf(int offset, int corner) const {
      offset += (corner >> 2) * 64 + (corner >> 1 & 1) * 8 + (corner & 1);
      return static_cast<float>(leaf_->getValue(static_cast<std::uint32_t>(offset)));
    }

    /// Remembers a leaf and its node; the root is one step away, and registers are scarce.
    nanovdb::ReadAccessor<Build, 0, 1> accessor_;
    const typename nanovdb::NanoTree<Build>::LeafNodeType *leaf_ = nullptr;
  };
};

/// Values of a volume by coordinates, for NanoVDB's builder.
template <class Value>
struct ValueAt {
  const GridVolume &volume;

  Value operator()(const nanovdb::Coord &at) const {
    const auto &dims = volume.dims;
    return static_cast<Value>(
        volume.values[at[0] + std::size_t{dims[0]} * (at[1] + std::size_t{dims[1]} * at[2])]);
  }
};

/// Value: what the builder takes, a float for all kinds of quantization.
template <class Build, class Value>
class NanoStorage {
 public:
  using Voxels = NanoVoxels<Build>;

  /// max_error: of FpN alone
  NanoStorage(Place place, const GridVolume &volume, float max_error) {
    const auto begin = std::chrono::steady_clock::now();
    handle_ = build(volume, max_error);
    if (place == Place::kDevice) {
      const std::size_t bytes = handle_.size();
      on_device_ = std::make_unique<PlacedBuffer<std::uint8_t>>(place, bytes);
      on_device_->write(handle_.data(), bytes);
    }
    build_ms_ =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
    max_voxel_error_ = error_of(volume);
    if (on_device_) handle_ = {};
  }

  Voxels voxels() const {
    if (!on_device_) return {handle_.template grid<Build>()};
    return {reinterpret_cast<const nanovdb::NanoGrid<Build> *>(on_device_->data())};
  }
  std::uint64_t bytes() const { return on_device_ ? on_device_->bytes() : handle_.size(); }
  double build_ms() const { return build_ms_; }
  double max_voxel_error() const { return max_voxel_error_; }

 private:
  static nanovdb::GridHandle<> build(const GridVolume &volume, float max_error) {
    nanovdb::GridBuilder<Value, Build> builder(static_cast<Value>(volume.values.front()));
    builder.setStats(nanovdb::StatsMode::Disable);  // costs time, and nothing here reads it
    builder.setChecksum(nanovdb::ChecksumMode::Disable);
    const auto last = [&](int a) { return static_cast<int>(volume.dims[a]) - 1; };
    builder(ValueAt<Value>{volume}, nanovdb::CoordBBox({0, 0, 0}, {last(0), last(1), last(2)}));
    return builder.getHandle(1.0, nanovdb::Vec3d(0), "", nanovdb::AbsDiff(max_error));
  }
  double error_of(const GridVolume &volume) const {
    const nanovdb::NanoGrid<Build> *grid = handle_.template grid<Build>();
    const ValueAt<float> exact{volume};
    float largest = 0;
    std::mutex mutex;
    nanovdb::forEach(0, volume.dims[2], 1, [&](const nanovdb::Range1D &layers) {
      const auto accessor = grid->getAccessor();
      float error = 0;
      nanovdb::Coord at;
      for (at[2] = int(layers.begin()); at[2] < int(layers.end()); ++at[2]) {
        for (at[1] = 0; at[1] < int(volume.dims[1]); ++at[1]) {
          for (at[0] = 0; at[0] < int(volume.dims[0]); ++at[0])
            error = std::max(error, std::abs(float(accessor.getValue(at)) - exact(at)));
        }
      }
      const std::lock_guard lock(mutex);
      largest = std::max(largest, error);
    });
    return largest;
  }

  nanovdb::GridHandle<> handle_;
  std::unique_ptr<PlacedBuffer<std::uint8_t>> on_device_;
  double build_ms_ = 0, max_voxel_error_ = 0;
};

/// What each kind of grid is made for.
struct GridWork {
  Place place;
  const GridVolume &volume;
  std::uint64_t max_pixels;
  float max_error;
  const WantedSides &wanted;
};

template <class Build, class Value = float>
void add_sides(std::vector<NamedSide> &sides, const GridWork &work, const std::string &name) {
  using Storage = NanoStorage<Build, Value>;
  const std::string bits = name + "_bits", ranges = name + "_ranges";
  if (!is_wanted(work.wanted, bits) && !is_wanted(work.wanted, ranges)) return;
  const auto storage = std::make_shared<const Storage>(work.place, work.volume, work.max_error);
  if (is_wanted(work.wanted, bits)) {
    sides.push_back({bits, std::make_unique<WalkedSide<Storage, true>>(
                               work.place, storage, work.volume, work.max_pixels)});
  }
  if (is_wanted(work.wanted, ranges)) {
    sides.push_back({ranges, std::make_unique<WalkedSide<Storage, false>>(
                                 work.place, storage, work.volume, work.max_pixels)});
  }
}

}  // namespace

std::vector<NamedSide> make_nanovdb_sides(Place place, const GridVolume &volume,
                                          std::uint64_t max_pixels, float max_error,
                                          const WantedSides &wanted) {
  const GridWork work{place, volume, max_pixels, max_error, wanted};
  std::vector<NamedSide> sides;
  add_sides<float>(sides, work, "nanovdb_float");
  add_sides<nanovdb::FpN>(sides, work, "nanovdb_fpn");
  add_sides<nanovdb::Fp8>(sides, work, "nanovdb_fp8");
  if (volume.is_uint8) add_sides<std::uint8_t, std::uint8_t>(sides, work, "nanovdb_uint8");
  return sides;
}

}  // namespace isowave::core::bench
