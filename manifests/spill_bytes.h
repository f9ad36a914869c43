// Converts values to bytes and back, for files that live no longer than their process (spill_file.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <vector>

namespace q3d::manifests {

// Appends values bit for bit.
class BytesWriter {
 public:
  explicit BytesWriter(std::vector<std::byte>& bytes) : bytes_(bytes) {}

  template <typename Value>
  void operator()(const Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    append(std::as_bytes(std::span(&value, 1)));
  }
  void operator()(const std::string& text) {
    (*this)(static_cast<std::uint64_t>(text.size()));
    append(std::as_bytes(std::span(text)));
  }

 private:
  void append(std::span<const std::byte> more) { bytes_.insert(bytes_.end(), more.begin(), more.end()); }
  std::vector<std::byte>& bytes_;
};

// Reads values from the front of the bytes, in the order in which they were written. Throws std::out_of_range
// if the bytes end too early.
class BytesReader {
 public:
  explicit BytesReader(std::span<const std::byte>& bytes) : bytes_(bytes) {}

  template <typename Value>
  void operator()(Value& value) {
    static_assert(std::is_trivially_copyable_v<Value>);
    std::memcpy(&value, take(sizeof(Value)).data(), sizeof(Value));
  }
  void operator()(std::string& text) {
    std::uint64_t size = 0;
    (*this)(size);
    const auto part = take(size);
    text.assign(reinterpret_cast<const char*>(part.data()), part.size());
  }

 private:
  std::span<const std::byte> take(std::size_t count) {
    if (count > bytes_.size()) throw std::out_of_range("spilled bytes end too early");
    const auto part = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return part;
  }
  std::span<const std::byte>& bytes_;
};

}  // namespace q3d::manifests
