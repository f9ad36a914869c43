// The names of the devices that a network may run on.
#pragma once

#include <string>
#include <vector>

namespace q3d::pipeline::config {

// Reads one device or several, separated by commas: auto, cpu, cuda, cuda:I. Only GPUs with a number can be
// several, and each may be named once. Throws ConfigError that names `where`.
std::vector<std::string> parse_devices(const std::string& text, const std::string& where);

// Throws ConfigError if the text names several GPUs, but not one for each of the machine's `ranks`, which
// share a work. A process that is alone is one rank.
void require_device_for_each_rank(const std::string& text, int ranks);

// Returns the device of a rank, by its number on its machine: of several GPUs, the one in its place. Work
// that ranks do not share is done on the first.
std::string device_of_rank(const std::string& text, int local_rank);

}  // namespace q3d::pipeline::config
