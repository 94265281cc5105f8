#pragma once
// What a command works on: an OpenCL device, or the host.

#include <CLI/CLI.hpp>
#include <initializer_list>
#include <memory>
#include <string>

#include "core/ocl/device.hpp"

namespace isowave::core::tools {

/// The first of these options that was given on the command line; empty: none.
std::string first_given(const CLI::App &command, std::initializer_list<const char *> names);

/// As ocl::choose_drawing(), but a device instead of the host by default if an option needs one.
///
/// selector       of --device
/// device_option  the name of a given option that only devices have; empty: there is none
/// Throws         Error: the user wants the host, or there is no device
ocl::DrawsOn choose_device_or_host(const std::string &selector, const std::string &device_option);

/// Opens a device, and says so in a line.
///
/// profiling  as for ocl::Device
std::unique_ptr<ocl::Device> open_and_say(const ocl::DeviceInfo &info, bool profiling = false);

/// Says in a line that the host works.
void say_host();

}  // namespace isowave::core::tools
