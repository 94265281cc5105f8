// A layer of OpenCL's loader whose calls fail from a certain one on, as those of a driver do that
// has lost its device:
//
//   OPENCL_LAYERS=libfailing_opencl.so FAILING_OPENCL_AT=n PROGRAM
//
// FAILING_OPENCL_AT    number of the first call that fails, from 1 on; none fails without it
// FAILING_OPENCL_ONCE  if set, the calls behind that one succeed again
// FAILING_OPENCL_COUNT file to which the number of calls is written when the process ends
//
// Calls that release objects are passed on, and not counted.

#undef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 300  // what the table of functions is complete with
#include <CL/cl_layer.h>

#include <atomic>
#include <cstdio>
#include <cstdlib>
#include <tuple>

#include "tests/layer_info.hpp"

namespace {

constexpr cl_int kError = CL_OUT_OF_RESOURCES;

cl_icd_dispatch driver, layer;
std::atomic<long> num_calls{0};
long fails_at = 0;
bool fails_once = false;

bool fails() {
  const long call = ++num_calls;
  return fails_at > 0 && (fails_once ? call == fails_at : call >= fails_at);
}

/// A function that returns its error.
template <auto kFunction, class... Args>
cl_int CL_API_CALL call(Args... args) {
  return fails() ? kError : (driver.*kFunction)(args...);
}

/// A function that returns a new object, and its error through the last argument.
template <auto kFunction, class Object, class... Args>
Object CL_API_CALL make(Args... args) {
  if (!fails()) return (driver.*kFunction)(args...);
  cl_int *error = std::get<sizeof...(Args) - 1>(std::tie(args...));
  if (error != nullptr) *error = kError;
  return nullptr;
}

template <auto kFunction, class... Args>
void wrap(cl_int (CL_API_CALL *cl_icd_dispatch::*)(Args...)) {
  layer.*kFunction = call<kFunction, Args...>;
}
template <auto kFunction, class Object, class... Args>
void wrap(Object (CL_API_CALL *cl_icd_dispatch::*)(Args...)) {
  layer.*kFunction = make<kFunction, Object, Args...>;
}
template <auto... kFunctions>
void wrap_all() {
  (wrap<kFunctions>(kFunctions), ...);
}

void write_count() {
  const char *path = std::getenv("FAILING_OPENCL_COUNT");
  std::FILE *file = path == nullptr ? nullptr : std::fopen(path, "w");
  if (file == nullptr) return;
  std::fprintf(file, "%ld\n", num_calls.load());
  std::fclose(file);
}

}  // namespace

cl_int clGetLayerInfo(cl_layer_info what, size_t size, void *value, size_t *needed) {
  return layer_info(what, size, value, needed);
}

cl_int clInitLayer(cl_uint, const cl_icd_dispatch *target, cl_uint *num_entries,
                   const cl_icd_dispatch **own) {
  driver = layer = *target;
  if (const char *at = std::getenv("FAILING_OPENCL_AT")) fails_at = std::atol(at);
  fails_once = std::getenv("FAILING_OPENCL_ONCE") != nullptr;
  using D = cl_icd_dispatch;
  wrap_all<&D::clGetPlatformIDs, &D::clGetPlatformInfo, &D::clGetDeviceIDs, &D::clGetDeviceInfo,
           &D::clCreateContext, &D::clCreateCommandQueue, &D::clCreateBuffer,
           &D::clSetMemObjectDestructorCallback, &D::clCreateProgramWithSource, &D::clBuildProgram,
           &D::clGetProgramInfo, &D::clGetProgramBuildInfo, &D::clCreateKernel, &D::clGetKernelInfo,
           &D::clSetKernelArg, &D::clEnqueueNDRangeKernel, &D::clEnqueueReadBuffer,
           &D::clEnqueueWriteBuffer, &D::clEnqueueCopyBuffer, &D::clEnqueueFillBuffer,
           &D::clEnqueueMapBuffer, &D::clEnqueueUnmapMemObject, &D::clEnqueueMarkerWithWaitList,
           &D::clEnqueueBarrierWithWaitList, &D::clWaitForEvents, &D::clGetEventInfo,
           &D::clGetEventProfilingInfo, &D::clFlush, &D::clFinish>();
  *num_entries = sizeof(layer) / sizeof(void *);
  *own = &layer;
  std::atexit(write_count);
  return CL_SUCCESS;
}
