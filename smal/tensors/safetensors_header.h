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
// length. Throws std::runtime_error naming the entry, got and expected: not a JSON object of flat objects, a
// name twice, an unknown dtype, a shape that disagrees with the offsets, offsets that overlap, leave holes or
// lie outside.
TensorFileHeader parse_header(std::span<const char> text, std::uint64_t data_bytes);

// The format's name of a dtype. Throws std::runtime_error when it has none.
const char* dtype_name(torch::ScalarType dtype);

// Names come from files: a message quotes no more than a bounded part of them.
std::string quote_name(const std::string& text);

}  // namespace q3d::smal::tensors
