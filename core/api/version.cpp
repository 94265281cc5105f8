#include "isowave/version.hpp"

namespace isowave {

std::string_view version() {
  return ISOWAVE_VERSION;
}

}  // namespace isowave
