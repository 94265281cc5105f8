#pragma once
// What a layer of OpenCL's loader says of itself: the body of clGetLayerInfo().

#include <CL/cl_layer.h>

#include <cstddef>

inline cl_int layer_info(cl_layer_info what, std::size_t size, void *value, std::size_t *needed) {
  if (what != CL_LAYER_API_VERSION) return CL_INVALID_VALUE;
  if (needed != nullptr) *needed = sizeof(cl_layer_api_version);
  if (value == nullptr) return CL_SUCCESS;
  if (size < sizeof(cl_layer_api_version)) return CL_INVALID_VALUE;
  *static_cast<cl_layer_api_version *>(value) = CL_LAYER_API_VERSION_100;
  return CL_SUCCESS;
}
