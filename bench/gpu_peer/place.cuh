#pragma once
// Memory, loops and clocks of the host or of the CUDA device.

#include <cuda_runtime.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>

#include "bench/gpu_peer/sides.hpp"

namespace isowave::core::bench {

/// Throws std::runtime_error if a call of CUDA failed.
inline void check_cuda(cudaError_t status) {
  if (status == cudaSuccess) return;
  throw std::runtime_error(std::string("CUDA: ") + cudaGetErrorString(status));
}

/// Values of one place.
template <class T>
class PlacedBuffer {
 public:
  PlacedBuffer(Place place, std::size_t count) : place_(place), count_(count) {
    if (place == Place::kHost) {
      data_ = new T[count]();
    } else {
      check_cuda(cudaMalloc(&data_, bytes()));
    }
  }
  ~PlacedBuffer() {
    if (place_ == Place::kHost) {
      delete[] data_;
    } else {
      cudaFree(data_);
    }
  }
  PlacedBuffer(const PlacedBuffer &) = delete;
  PlacedBuffer &operator=(const PlacedBuffer &) = delete;

  T *data() const { return data_; }
  std::size_t size() const { return count_; }
  std::size_t bytes() const { return count_ * sizeof(T); }
  /// Copies the first values to the host. Waits.
  void read(T *to, std::size_t count) const {
    const auto kind = place_ == Place::kHost ? cudaMemcpyHostToHost : cudaMemcpyDeviceToHost;
    copy(to, data_, count, kind);
  }
  /// Copies values from the host. Waits.
  void write(const T *from, std::size_t count) {
    const auto kind = place_ == Place::kHost ? cudaMemcpyHostToHost : cudaMemcpyHostToDevice;
    copy(data_, from, count, kind);
  }

 private:
  static void copy(T *to, const T *from, std::size_t count, cudaMemcpyKind kind) {
    if (kind == cudaMemcpyHostToHost) {
      std::copy(from, from + count, to);  // without CUDA, which may not be there
    } else {
      check_cuda(cudaMemcpy(to, from, count * sizeof(T), kind));
    }
  }

  Place place_;
  std::size_t count_;
  T *data_ = nullptr;
};

/// Host memory that a device copies to without a copy on the way.
class PinnedBytes {
 public:
  PinnedBytes(Place place, std::size_t count) : place_(place), count_(count) {
    if (place == Place::kHost) {
      data_ = new std::uint8_t[count]();
    } else {
      check_cuda(cudaMallocHost(&data_, count));
    }
  }
  ~PinnedBytes() {
    if (place_ == Place::kHost) {
      delete[] data_;
    } else {
      cudaFreeHost(data_);
    }
  }
  PinnedBytes(const PinnedBytes &) = delete;
  PinnedBytes &operator=(const PinnedBytes &) = delete;

  std::uint8_t *data() const { return data_; }
  std::size_t size() const { return count_; }

 private:
  Place place_;
  std::size_t count_;
  std::uint8_t *data_ = nullptr;
};

/// The time of work on a place: of a device by events.
class PlaceTimer {
 public:
  explicit PlaceTimer(Place place) : place_(place) {
    if (place == Place::kHost) return;
    check_cuda(cudaEventCreate(&begin_));
    check_cuda(cudaEventCreate(&end_));
  }
  ~PlaceTimer() {
    if (begin_ != nullptr) cudaEventDestroy(begin_);
    if (end_ != nullptr) cudaEventDestroy(end_);
  }
  PlaceTimer(const PlaceTimer &) = delete;
  PlaceTimer &operator=(const PlaceTimer &) = delete;

  /// Does the work, waits, and returns its ms.
  template <class Work>
  double ms_of(const Work &work) {
    if (place_ == Place::kHost) {
      const auto begin = std::chrono::steady_clock::now();
      work();
      return std::chrono::duration<double, std::milli>(std::chrono::steady_clock::now() - begin)
          .count();
    }
    check_cuda(cudaEventRecord(begin_));
    work();
    check_cuda(cudaGetLastError());
    check_cuda(cudaEventRecord(end_));
    check_cuda(cudaEventSynchronize(end_));
    float ms = 0;
    check_cuda(cudaEventElapsedTime(&ms, begin_, end_));
    return ms;
  }

 private:
  Place place_;
  cudaEvent_t begin_ = nullptr, end_ = nullptr;
};

template <class Function>
__global__ void call_each(Function function, std::uint32_t count) {
  const std::uint32_t i = blockIdx.x * blockDim.x + threadIdx.x;
  if (i < count) function(i);
}

/// function(i) of 0 <= i < count, in any order; a device goes on meanwhile.
template <class Function>
void for_each(Place place, std::uint32_t count, const Function &function) {
  if (count == 0) return;
  if (place == Place::kHost) {
    for (std::uint32_t i = 0; i < count; ++i) function(i);
    return;
  }
  constexpr std::uint32_t kThreads = 128;
  call_each<<<(count + kThreads - 1) / kThreads, kThreads>>>(function, count);
}

}  // namespace isowave::core::bench
