#include "core/api/guarded.hpp"

#include <filesystem>
#include <new>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>

#ifdef ISOWAVE_HAS_OPENCL
#include "core/ocl/device.hpp"
#endif

namespace isowave::core {

namespace {

std::string text_of(const std::filesystem::filesystem_error &error) {
  return fmt::format("{}: {}", error.path1().string(), error.code().message());
}

/// Without "[json.exception.type_error.302] ".
std::string text_of(const nlohmann::json::exception &error) {
  const std::string_view text = error.what();
  const std::size_t end = text.find("] ");
  return std::string(end == std::string_view::npos ? text : text.substr(end + 2));
}

}  // namespace

std::string text_of_current_exception(std::string_view doing) {
  try {
    throw;
  } catch (const isowave::Error &error) {
    return error.what();
  } catch (const std::filesystem::filesystem_error &error) {
    return text_of(error);
  } catch (const std::bad_alloc &) {
    return fmt::format("out of memory: {} needs more than there is", doing);
  } catch (const std::length_error &) {
    return fmt::format("out of memory: {} needs more than a program can have", doing);
  } catch (const nlohmann::json::exception &error) {
    return fmt::format("{} failed: JSON: {}", doing, text_of(error));
#ifdef ISOWAVE_HAS_OPENCL
  } catch (const cl::Error &error) {
    return fmt::format("{} failed in OpenCL: {}: {}", doing, error.what(),
                       ocl::error_name(error.err()));
#endif
  } catch (const std::system_error &error) {
    return fmt::format("{} failed: {}", doing, error.code().message());
  } catch (const std::exception &error) {
    return error.what();
  } catch (...) {
    return fmt::format("{} failed, and nothing says why", doing);
  }
}

}  // namespace isowave::core
