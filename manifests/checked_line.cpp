#include "manifests/checked_line.h"

#include <stdexcept>

#include "manifests/digest.h"

namespace q3d::manifests {
namespace {
constexpr std::size_t kCheckDigits = 16;
}

std::string seal_line(std::string_view payload) {
  if (payload.find('\n') != std::string_view::npos) {
    throw std::invalid_argument("a checked line must not contain a line feed");
  }
  std::string line(payload);
  line += '\t';
  line += std::string_view(sha256(payload)).substr(0, kCheckDigits);
  line += '\n';
  return line;
}

std::optional<std::string_view> open_line(std::string_view line) {
  if (line.size() < kCheckDigits + 1) return std::nullopt;
  const std::size_t tab = line.size() - kCheckDigits - 1;
  const std::string_view payload = line.substr(0, tab);
  if (line[tab] != '\t' ||
      std::string_view(sha256(payload)).substr(0, kCheckDigits) != line.substr(tab + 1)) {
    return std::nullopt;
  }
  return payload;
}

}  // namespace q3d::manifests
