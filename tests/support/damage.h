// Damages files at random places, as a decaying disk does, as often as the environment says.
#pragma once

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <random>
#include <stdexcept>
#include <string>

#include "manifests/atomic_file.h"

namespace q3d::testing {

// Returns a number from the environment, for the long runs of `make torture`.
inline std::int64_t number_from_environment(const char* name, std::int64_t otherwise) {
  const char* given = std::getenv(name);
  return given != nullptr && *given != '\0' ? std::stoll(given) : otherwise;
}

struct Damaged {
  std::string before;  // the bytes of the file
  std::size_t at = 0;  // the first byte that differs or is gone
  std::string text;    // what was done
};

// Flips one bit, or cuts the file to a shorter length. It writes in place, as damage does: the inode stays,
// and so do other names of the file.
inline Damaged damage_file(const std::filesystem::path& path, bool cuts, std::mt19937_64& random) {
  Damaged damaged{manifests::read_file(path), 0, ""};
  if (damaged.before.empty()) throw std::invalid_argument(path.string() + " is empty");
  std::string content = damaged.before;
  damaged.at = random() % content.size();
  if (cuts) {
    content.resize(damaged.at);
    damaged.text = "cut to " + std::to_string(damaged.at) + " bytes";
  } else {
    const auto bit = static_cast<int>(random() % 8);
    content[damaged.at] = static_cast<char>(content[damaged.at] ^ (1 << bit));
    damaged.text = "bit " + std::to_string(bit) + " of byte " + std::to_string(damaged.at) + " flipped";
  }
  std::filesystem::permissions(path, std::filesystem::perms::owner_write, std::filesystem::perm_options::add);
  std::ofstream(path, std::ios::binary) << content;
  return damaged;
}

}  // namespace q3d::testing
