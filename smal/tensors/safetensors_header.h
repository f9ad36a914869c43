// The JSON header of a safetensors file.
#pragma once

#include <torch/types.h>

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <vector>

namespace q3d::smal::tensors {

inline constexpr const char* kMetadataKey = "__metadata__";

struct TensorEntry {
  torch::ScalarType dtype;
  std::vector<std::int64_t> shape;
  std::uint64_t begin;  // bytes from the start of the data part
  std::uint64_t end;
};

struct TensorFileHeader {
  std::map<std::string, TensorEntry> entries;
  std::map<std::string, std::string> metadata;
};

// Reads the header of a file with `data_bytes` bytes behind it. Time and memory are bounded by the text's
// length. Throws std::runtime_error that names the entry, what was found and what was expected, if the header
// is not a JSON object of flat objects, gives a name twice, has an unknown dtype or a shape that disagrees
// with the offsets, or if offsets overlap, leave holes or lie outside.
TensorFileHeader parse_header(std::span<const char> text, std::uint64_t data_bytes);

// Returns the format's name of a dtype. Throws std::runtime_error if it has none.
const char* dtype_name(torch::ScalarType dtype);

// Quotes a name for a message. Names come from files, so at most a bounded part is quoted.
std::string quote_name(const std::string& text);

}  // namespace q3d::smal::tensors
