// Fuzz targets share one scratch folder for the whole run, and checks that stop it.
//
// A target is LLVMFuzzerTestOneInput: libFuzzer calls it with inputs that it breeds, replay.cpp with those
// that lie in folders. It checks what a reader promises of any bytes whatever: a value, or a
// std::runtime_error that names the file. Any other exception ends the run as a crash does.
#pragma once

#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>

namespace q3d::fuzz {

// Stops the run; the input is then a finding.
inline void require(bool holds, std::string_view promise, std::string_view got = {}) {
  if (holds) return;
  std::cerr << "broken promise: " << promise << '\n' << got << '\n';
  std::abort();
}

class Scratch {
 public:
  Scratch() : root_(std::filesystem::temp_directory_path() / ("q3d_fuzz_" + std::to_string(::getpid()))) {
    std::filesystem::create_directories(root_);
  }
  ~Scratch() {
    std::error_code ignored;
    std::filesystem::remove_all(root_, ignored);
  }
  Scratch(const Scratch&) = delete;
  Scratch& operator=(const Scratch&) = delete;

  const std::filesystem::path& root() const { return root_; }
  std::filesystem::path write(const std::string& name, std::string_view bytes) const {
    std::filesystem::create_directories((root_ / name).parent_path());
    std::ofstream stream(root_ / name, std::ios::binary);
    stream.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
    stream.close();
    require(stream.good(), "the scratch folder can be written");
    return root_ / name;
  }

 private:
  std::filesystem::path root_;
};

inline std::string_view as_text(const std::uint8_t* data, std::size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

// The input of a target that covers several readers: its first byte names the reader. A seed in the corpus
// begins with that letter.
struct Chosen {
  char reader = 0;  // 0 for an empty input
  std::string_view bytes;
};
inline Chosen chosen_reader(const std::uint8_t* data, std::size_t size) {
  if (size == 0) return {};
  return {static_cast<char>(data[0]), as_text(data + 1, size - 1)};
}

// Cuts an input for a reader of two files at the first record separator (0x1E). The second file is empty
// without one.
inline std::pair<std::string_view, std::string_view> two_files(std::string_view bytes) {
  const std::size_t at = std::min(bytes.find('\x1e'), bytes.size());
  return {bytes.substr(0, at), bytes.substr(std::min(at + 1, bytes.size()))};
}

// Runs `read`, which may refuse `file`: then its message must name it.
template <typename Error = std::runtime_error, typename Read>
void value_or_refusal(const std::filesystem::path& file, const Read& read) {
  try {
    read();
  } catch (const Error& error) {
    // Q3D_FUZZ_REFUSALS=1 shows whether a seed is read at all.
    if (std::getenv("Q3D_FUZZ_REFUSALS") != nullptr) std::cerr << "refused: " << error.what() << '\n';
    require(std::string_view(error.what()).find(file.filename().string()) != std::string_view::npos,
            "a refusal names the file", error.what());
  }
}

}  // namespace q3d::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);
