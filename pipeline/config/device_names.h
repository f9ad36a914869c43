// The names of the devices that a network may run on.
#pragma once

#include <string>
#include <vector>

namespace q3d::pipeline::config {

// Reads one device or several, separated by commas: auto, cpu, cuda, cuda:I. Only GPUs with a number can be
// several, and each may be named once. Throws ConfigError that names `where`.
std::vector<std::string> parse_devices(const std::string& text, const std::string& where);

// Throws ConfigError if the text is no list of devices, or names several: one process uses one device today.
void require_one_device(const std::string& text, const std::string& where);

}  // namespace q3d::pipeline::config
