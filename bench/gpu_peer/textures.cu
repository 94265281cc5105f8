// Every voxel in a 3D texture of CUDA.

#include <algorithm>
#include <vector>

#include "bench/gpu_peer/walked_side.cuh"

namespace isowave::core::bench {

namespace {

/// On the host, an array.
template <class T>
struct DenseVoxels {
  int nx, ny;
  const T *values;
  cudaTextureObject_t texture;

  class Reader {
   public:
    PEER_BOTH explicit Reader(const DenseVoxels &voxels) : voxels_(voxels) {}
    PEER_BOTH void enter(const int *) {}
    PEER_BOTH float value(int x, int y, int z) const {
#ifdef __CUDA_ARCH__
      return static_cast<float>(
          tex3D<T>(voxels_.texture, float(x) + 0.5f, float(y) + 0.5f, float(z) + 0.5f));
#else
      return static_cast<float>(
          voxels_.values[x + std::size_t(voxels_.nx) * (y + std::size_t(voxels_.ny) * z)]);
#endif
    }
    PEER_BOTH void corners(const int cell[3], float f[8]) const {
      for (int i = 0; i < 8; ++i)
        f[i] = value(cell[0] + (i >> 2), cell[1] + (i >> 1 & 1), cell[2] + (i & 1));
    }

   private:
    DenseVoxels voxels_;
  };
};

template <class T>
class DenseStorage {
 public:
  using Voxels = DenseVoxels<T>;

  DenseStorage(Place place, const GridVolume &volume)
      : dims_{volume.dims[0], volume.dims[1], volume.dims[2]} {
    const auto begin = std::chrono::steady_clock::now();
    std::vector<T> values(volume.values.size());
    std::transform(volume.values.begin(), volume.values.end(), values.begin(),
                   [](float value) { return static_cast<T>(value); });
    if (place == Place::kHost) {
      values_ = std::move(values);
    } else {
      upload(values);
    }
    build_ms_ =
        std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin).count();
  }
  ~DenseStorage() {
    if (texture_ != 0) cudaDestroyTextureObject(texture_);
    if (array_ != nullptr) cudaFreeArray(array_);
  }
  DenseStorage(const DenseStorage &) = delete;
  DenseStorage &operator=(const DenseStorage &) = delete;

  Voxels voxels() const {
    return {static_cast<int>(dims_.width), static_cast<int>(dims_.height), values_.data(),
            texture_};
  }
  std::uint64_t bytes() const {
    return std::uint64_t{dims_.width} * dims_.height * dims_.depth * sizeof(T);
  }
  double build_ms() const { return build_ms_; }
  double max_voxel_error() const { return 0; }

 private:
  void upload(std::vector<T> &values) {
    const cudaChannelFormatDesc format = cudaCreateChannelDesc<T>();
    check_cuda(cudaMalloc3DArray(&array_, &format, dims_));
    cudaMemcpy3DParms copy{};
    copy.srcPtr =
        make_cudaPitchedPtr(values.data(), dims_.width * sizeof(T), dims_.width, dims_.height);
    copy.dstArray = array_;
    copy.extent = dims_;
    copy.kind = cudaMemcpyHostToDevice;
    check_cuda(cudaMemcpy3D(&copy));
    cudaResourceDesc resource{};
    resource.resType = cudaResourceTypeArray;
    resource.res.array.array = array_;
    cudaTextureDesc how{};  // the voxels themselves: filters interpolate with 8 bits
    for (auto &mode : how.addressMode) mode = cudaAddressModeClamp;
    how.filterMode = cudaFilterModePoint;
    how.readMode = cudaReadModeElementType;
    check_cuda(cudaCreateTextureObject(&texture_, &resource, &how, nullptr));
  }

  cudaExtent dims_;
  std::vector<T> values_;  ///< on the host
  cudaArray_t array_ = nullptr;
  cudaTextureObject_t texture_ = 0;
  double build_ms_ = 0;
};

template <class T>
void add_side(std::vector<NamedSide> &sides, Place place, const GridVolume &volume,
              std::uint64_t max_pixels, const WantedSides &wanted, const std::string &name) {
  using Storage = DenseStorage<T>;
  if (!is_wanted(wanted, name)) return;
  sides.push_back({name, std::make_unique<WalkedSide<Storage, false>>(
                             place, std::make_shared<Storage>(place, volume), volume, max_pixels)});
}

}  // namespace

std::vector<NamedSide> make_texture_sides(Place place, const GridVolume &volume,
                                          std::uint64_t max_pixels, const WantedSides &wanted) {
  std::vector<NamedSide> sides;
  if (volume.is_uint8)
    add_side<std::uint8_t>(sides, place, volume, max_pixels, wanted, "texture_uint8");
  add_side<float>(sides, place, volume, max_pixels, wanted, "texture_float");
  return sides;
}

GpuInfo gpu_info() {
  GpuInfo info;
  int device = 0;
  check_cuda(cudaGetDevice(&device));
  cudaDeviceProp properties{};
  check_cuda(cudaGetDeviceProperties(&properties, device));
  info.name = properties.name;
  check_cuda(cudaDriverGetVersion(&info.driver));
  check_cuda(cudaRuntimeGetVersion(&info.runtime));
  std::size_t free_bytes = 0, all_bytes = 0;
  check_cuda(cudaMemGetInfo(&free_bytes, &all_bytes));
  info.used_bytes = all_bytes - free_bytes;
  return info;
}

}  // namespace isowave::core::bench
