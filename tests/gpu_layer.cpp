// A layer of OpenCL's loader that calls all devices GPUs, for what draws by default on a machine
// with a GPU:
//
//   OPENCL_LAYERS=libgpu_layer.so PROGRAM

#undef CL_TARGET_OPENCL_VERSION
#define CL_TARGET_OPENCL_VERSION 300  // what the table of functions is complete with
#include <CL/cl_layer.h>

#include "tests/layer_info.hpp"

namespace {

cl_icd_dispatch driver, layer;

cl_int CL_API_CALL get_device_info(cl_device_id device, cl_device_info what, size_t size,
                                   void *value, size_t *needed) {
  const cl_int status = driver.clGetDeviceInfo(device, what, size, value, needed);
  if (status == CL_SUCCESS && what == CL_DEVICE_TYPE && value != nullptr)
    *static_cast<cl_device_type *>(value) = CL_DEVICE_TYPE_GPU;
  return status;
}

}  // namespace

cl_int clGetLayerInfo(cl_layer_info what, size_t size, void *value, size_t *needed) {
  return layer_info(what, size, value, needed);
}

cl_int clInitLayer(cl_uint, const cl_icd_dispatch *target, cl_uint *num_entries,
                   const cl_icd_dispatch **own) {
  driver = layer = *target;
  layer.clGetDeviceInfo = get_device_info;
  *num_entries = sizeof(layer) / sizeof(void *);
  *own = &layer;
  return CL_SUCCESS;
}
