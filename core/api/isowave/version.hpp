#pragma once

#include <string_view>

namespace isowave {

/// Of the library that is linked: "0.1.0".
std::string_view version();

}  // namespace isowave
