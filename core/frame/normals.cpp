#include "core/frame/normals.hpp"

#include "core/base/error.hpp"

namespace isowave::core {

std::string_view to_string(Normals normals) {
  return normals == Normals::kSmooth ? "smooth" : "cell";
}

Normals normals_from_string(std::string_view name) {
  for (const Normals normals : {Normals::kSmooth, Normals::kCell}) {
    if (name == to_string(normals)) return normals;
  }
  throw Error("unknown normals '{}': there are smooth and cell", name);
}

}  // namespace isowave::core
