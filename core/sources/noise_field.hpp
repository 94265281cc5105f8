#pragma once
// Synthetic fields of gradient noise (kernels_cl/portable/noise.h).

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "core/sources/field_rows.hpp"
#include "kernels_cl/portable/noise.h"

namespace isowave::core {

/// A field on a grid.
struct NoiseField {
  NoiseShape shape{};
  std::vector<NoiseOctave> octaves{};  ///< group a, then group b
};

/// The noise of a field; none if the field has no noise.
std::optional<NoiseField> make_noise_field(Field field, const glm::uvec3 &dims, std::uint64_t seed);

/// The field's rows of nx voxels, evaluated by the host.
std::unique_ptr<FieldRows> make_noise_rows(NoiseField field, std::uint32_t nx);

}  // namespace isowave::core
