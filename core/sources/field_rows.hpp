#pragma once
// The synthetic fields of generate.hpp, evaluated a row of voxels at a time.

#include <cstdint>
#include <glm/glm.hpp>
#include <memory>
#include <span>

#include "core/sources/generate.hpp"

namespace isowave::core {

/// One field on one grid. evaluate() may be called from many threads at once.
class FieldRows {
 public:
  virtual ~FieldRows() = default;
  /// Values in [0, 1] of voxels (0..nx-1, y, z) to `row` [nx].
  virtual void evaluate(std::uint32_t y, std::uint32_t z, std::span<double> row) const = 0;
};

std::unique_ptr<FieldRows> make_field_rows(Field field, const glm::uvec3 &dims, std::uint64_t seed);

}  // namespace isowave::core
