#include "smal/tensors/safetensors_header.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <tuple>

namespace q3d::smal::tensors {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxRank = 64;  // LibTorch's own limit

struct DtypeName {
  const char* name;
  torch::ScalarType type;
};
constexpr DtypeName kDtypes[] = {
    {"F64", torch::kFloat64}, {"F32", torch::kFloat32}, {"F16", torch::kFloat16}, {"BF16", torch::kBFloat16},
    {"I64", torch::kInt64},   {"I32", torch::kInt32},   {"I16", torch::kInt16},   {"I8", torch::kInt8},
    {"U8", torch::kUInt8},    {"BOOL", torch::kBool}};

torch::ScalarType parse_dtype(const json& value) {
  if (value.is_string()) {
    for (const DtypeName& known : kDtypes) {
      if (value.get_ref<const std::string&>() == known.name) return known.type;
    }
  }
  throw std::runtime_error("unknown dtype " + quote_name(value.dump()) +
                           ", expected F64, F32, F16, BF16, I64, I32, I16, I8, U8 or BOOL");
}

// Returns the number of bytes that a tensor of this shape takes. Zero sizes count as one for the overflow
// check, because LibTorch multiplies the others into strides.
std::uint64_t byte_count(const std::vector<std::int64_t>& shape, torch::ScalarType dtype) {
  auto bound = static_cast<std::int64_t>(torch::elementSize(dtype));
  bool empty = false;
  for (const std::int64_t size : shape) {
    empty = empty || size == 0;
    if (__builtin_mul_overflow(bound, std::max<std::int64_t>(size, 1), &bound)) {
      throw std::runtime_error("the product of its sizes overflows");
    }
  }
  return empty ? 0 : static_cast<std::uint64_t>(bound);
}

const json& field(const json& object, const char* key) {
  const auto found = object.find(key);
  if (found == object.end()) throw std::runtime_error(fmt::format("has no '{}'", key));
  return *found;
}

std::vector<std::int64_t> parse_sizes(const json& object, const char* key) {
  const json& array = field(object, key);
  if (!array.is_array()) throw std::runtime_error(fmt::format("'{}' is not a list", key));
  std::vector<std::int64_t> numbers;
  for (const json& number : array) {
    constexpr auto kLargest = static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max());
    if (!number.is_number_unsigned() || number.get<std::uint64_t>() > kLargest) {
      throw std::runtime_error(
          fmt::format("'{}' holds {}, expected integers from 0 to 2^63 - 1", key, quote_name(number.dump())));
    }
    numbers.push_back(number.get<std::int64_t>());
  }
  return numbers;
}

TensorEntry parse_entry(const json& object, std::uint64_t data_bytes) {
  TensorEntry entry{parse_dtype(field(object, "dtype")), parse_sizes(object, "shape"), 0, 0};
  const std::vector<std::int64_t> offsets = parse_sizes(object, "data_offsets");
  if (offsets.size() != 2) {
    throw std::runtime_error(fmt::format("has {} data_offsets, expected 2", offsets.size()));
  }
  entry.begin = static_cast<std::uint64_t>(offsets[0]);
  entry.end = static_cast<std::uint64_t>(offsets[1]);
  if (entry.begin > entry.end || entry.end > data_bytes) {
    throw std::runtime_error(fmt::format("has data_offsets [{}, {}), outside the {} bytes of data",
                                         entry.begin, entry.end, data_bytes));
  }
  const std::uint64_t expected = byte_count(entry.shape, entry.dtype);
  if (entry.end - entry.begin != expected) {
    throw std::runtime_error(
        fmt::format("has {} bytes, expected {} from its shape and dtype", entry.end - entry.begin, expected));
  }
  return entry;
}

// Reads the header while it is being parsed: every entry is checked and dropped from the JSON tree as soon as
// it closes, so that no input builds a tree much larger than one entry.
class HeaderReader {
 public:
  explicit HeaderReader(std::uint64_t data_bytes) : data_bytes_(data_bytes) {}

  TensorFileHeader read(std::span<const char> text) {
    const json root = json::parse(
        text.begin(), text.end(),
        [this](int depth, json::parse_event_t event, json& parsed) { return keep(depth, event, parsed); });
    if (!root.is_object()) throw std::runtime_error("the header is not a JSON object");
    return std::move(header_);
  }

 private:
  // Depth 0 is the header, 1 an entry, 2 its fields, 3 the numbers of a shape or of the offsets.
  bool keep(int depth, json::parse_event_t event, json& parsed) {
    using Event = json::parse_event_t;
    const bool opens = event == Event::object_start || event == Event::array_start;
    if ((depth == 0 && event != Event::object_start && event != Event::object_end) ||
        (depth == 1 && (event == Event::array_start || event == Event::value)) ||
        (depth == 2 && event == Event::object_start) || (depth > 2 && opens)) {
      throw std::runtime_error("the header is not an object of flat objects" +
                               (name_.empty() ? std::string() : ", see " + quote_name(name_)));
    }
    if (event == Event::key && depth == 1) begin_entry(parsed.get_ref<const std::string&>());
    if (event == Event::key && depth == 2 && !keys_.insert(parsed.get<std::string>()).second) {
      throw std::runtime_error("entry " + quote_name(name_) + " has a key twice");
    }
    if (event == Event::array_start) numbers_ = 0;
    if (event == Event::value && depth > 2 && ++numbers_ > kMaxRank) {
      throw std::runtime_error(fmt::format("entry {} has more than {} sizes", quote_name(name_), kMaxRank));
    }
    if (event == Event::object_end && depth == 1) {
      end_entry(parsed);
      return false;
    }
    return true;
  }

  void begin_entry(const std::string& name) {
    if (header_.entries.count(name) > 0 || (name == kMetadataKey && metadata_seen_)) {
      throw std::runtime_error("the name " + quote_name(name) + " appears twice");
    }
    name_ = name;
    keys_.clear();
  }

  void end_entry(const json& object) {
    try {
      if (name_ == kMetadataKey) {
        metadata_seen_ = true;
        for (const auto& [key, value] : object.items()) {
          if (!value.is_string()) throw std::runtime_error(quote_name(key) + " is not a string");
          header_.metadata.emplace(key, value.get<std::string>());
        }
      } else {
        header_.entries.emplace(name_, parse_entry(object, data_bytes_));
      }
    } catch (const std::runtime_error& error) {
      throw std::runtime_error("entry " + quote_name(name_) + ": " + error.what());
    }
  }

  std::uint64_t data_bytes_;
  TensorFileHeader header_;
  std::string name_;
  std::set<std::string> keys_;
  std::size_t numbers_ = 0;
  bool metadata_seen_ = false;
};

// The tensors must tile the data part: a hole could hide bytes, an overlap could alias tensors.
void check_tiling(const std::map<std::string, TensorEntry>& entries, std::uint64_t data_bytes) {
  std::vector<const std::pair<const std::string, TensorEntry>*> order;
  for (const auto& entry : entries) order.push_back(&entry);
  std::sort(order.begin(), order.end(), [](const auto* a, const auto* b) {
    return std::tie(a->second.begin, a->second.end) < std::tie(b->second.begin, b->second.end);
  });
  std::uint64_t reached = 0;
  for (const auto* entry : order) {
    if (entry->second.begin != reached) {
      throw std::runtime_error(fmt::format(
          "entry {}: starts at byte {}, {}, expected {}", quote_name(entry->first), entry->second.begin,
          entry->second.begin < reached ? "inside another entry" : "after a hole", reached));
    }
    reached = entry->second.end;
  }
  if (reached != data_bytes) {
    throw std::runtime_error(
        fmt::format("the data has {} bytes, expected {} from its entries", data_bytes, reached));
  }
}

}  // namespace

TensorFileHeader parse_header(std::span<const char> text, std::uint64_t data_bytes) {
  try {
    TensorFileHeader header = HeaderReader(data_bytes).read(text);
    check_tiling(header.entries, data_bytes);
    return header;
  } catch (const json::exception& error) {
    throw std::runtime_error("the header is not JSON: " + std::string(error.what()).substr(0, 300));
  }
}

const char* dtype_name(torch::ScalarType dtype) {
  for (const DtypeName& known : kDtypes) {
    if (known.type == dtype) return known.name;
  }
  throw std::runtime_error(fmt::format("dtype {} has no name in safetensors", torch::toString(dtype)));
}

std::string quote_name(const std::string& text) {
  constexpr std::size_t kLongest = 120;
  return text.size() <= kLongest ? "'" + text + "'" : "'" + text.substr(0, kLongest) + "...'";
}

}  // namespace q3d::smal::tensors
