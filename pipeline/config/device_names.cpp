#include "pipeline/config/device_names.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "pipeline/run/errors.h"
#include "pipeline/run/words.h"

namespace q3d::pipeline::config {
namespace {

constexpr const char* kKey = "network.device";

bool is_numbered_gpu(std::string_view name) {
  constexpr std::string_view kPrefix = "cuda:";
  if (!name.starts_with(kPrefix)) return false;
  int index = -1;
  const char* end = name.data() + name.size();
  const auto [stop, error] = std::from_chars(name.data() + kPrefix.size(), end, index);
  return error == std::errc() && stop == end && index >= 0 && index <= 127;
}

std::vector<std::string> parted(std::string_view text) {
  std::vector<std::string> parts;
  while (true) {
    const std::size_t end = text.find(',');
    parts.emplace_back(text.substr(0, end));
    if (end == std::string_view::npos) return parts;
    text.remove_prefix(end + 1);
  }
}

}  // namespace

std::vector<std::string> parse_devices(const std::string& text, const std::string& where) {
  std::vector<std::string> devices = parted(text);
  for (auto device = devices.begin(); device != devices.end(); ++device) {
    const bool is_word = *device == "auto" || *device == "cpu" || *device == "cuda";
    if (!is_numbered_gpu(*device) && !(is_word && devices.size() == 1)) {
      throw run::ConfigError(fmt::format(
          "{}: got \"{}\", expected auto, cpu, cuda, cuda:I or several GPUs such as cuda:0,cuda:1", where,
          text));
    }
    if (std::find(devices.begin(), device, *device) != device) {
      throw run::ConfigError(
          fmt::format("{}: got {} twice in \"{}\", expected each device once", where, *device, text));
    }
  }
  return devices;
}

void require_device_for_each_rank(const std::string& text, int ranks) {
  const std::size_t count = parse_devices(text, kKey).size();
  if (count == 1 || count == static_cast<std::size_t>(ranks)) return;
  throw run::ConfigError(
      fmt::format("{}: got {} GPUs (\"{}\") for {}, expected one for each. Add --ranks {}, or name one GPU",
                  kKey, count, text, run::counted(ranks, "process", "processes"), count));
}

std::string device_of_rank(const std::string& text, int local_rank) {
  const std::vector<std::string> devices = parse_devices(text, kKey);
  return devices[static_cast<std::size_t>(local_rank) % devices.size()];
}

}  // namespace q3d::pipeline::config
