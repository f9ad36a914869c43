#include "manifests/path_table.h"

#include <algorithm>
#include <cstring>
#include <functional>
#include <limits>
#include <numeric>
#include <stdexcept>

namespace q3d::manifests {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 16U;
constexpr unsigned kBlockBits = 32;  // low bits of a position; the bits above are the block's number
constexpr std::size_t kFirstSlots = 64;

std::uint32_t hash_of(std::string_view path) {
  return static_cast<std::uint32_t>(std::hash<std::string_view>()(path));
}

std::pair<std::string_view, std::string_view> split(std::string_view path) {
  const std::size_t slash = path.rfind('/');
  const std::size_t cut = slash == std::string_view::npos ? 0 : slash + 1;
  return {path.substr(0, cut), path.substr(cut)};
}

}  // namespace

std::string_view PathTable::name(std::uint32_t number) const {
  const std::uint64_t position = entries_[number].position;
  const char* at = blocks_[position >> kBlockBits].data() + static_cast<std::uint32_t>(position);
  std::uint32_t length = 0;
  std::memcpy(&length, at, sizeof(length));
  return {at + sizeof(length), length};
}

std::string PathTable::path(std::uint32_t number) const {
  return folder(number) + std::string(name(number));
}

// Returns the slot that holds the path, or the empty one that it would take.
std::size_t PathTable::slot_of(std::uint32_t hash, std::string_view path) const {
  const auto [folder_text, name_text] = split(path);
  std::size_t slot = hash & (slots_.size() - 1);
  while (slots_[slot] != 0) {
    const std::uint32_t number = slots_[slot] - 1;
    if (entries_[number].hash == hash && name(number) == name_text && folder(number) == folder_text) break;
    slot = (slot + 1) & (slots_.size() - 1);
  }
  return slot;
}

std::optional<std::uint32_t> PathTable::find(std::string_view path) const {
  if (slots_.empty()) return std::nullopt;
  const std::uint32_t entry = slots_[slot_of(hash_of(path), path)];
  return entry == 0 ? std::nullopt : std::optional(entry - 1);
}

std::pair<std::uint32_t, bool> PathTable::add(std::string_view path) {
  if (4 * (entries_.size() + 1) > 3 * slots_.size()) grow();
  const std::uint32_t hash = hash_of(path);
  const std::size_t slot = slot_of(hash, path);
  if (slots_[slot] != 0) return {slots_[slot] - 1, false};
  if (entries_.size() + 1 >= std::numeric_limits<std::uint32_t>::max()) {
    throw std::length_error("more than 2^32 - 2 paths");
  }
  const auto [folder_text, name_text] = split(path);
  const auto [folder, is_new] =
      folder_numbers_.try_emplace(std::string(folder_text), static_cast<std::uint32_t>(folders_.size()));
  if (is_new) folders_.push_back(&folder->first);
  entries_.push_back({folder->second, hash, keep(name_text)});
  slots_[slot] = static_cast<std::uint32_t>(entries_.size());
  return {slots_[slot] - 1, true};
}

std::uint64_t PathTable::keep(std::string_view name) {
  const auto length = static_cast<std::uint32_t>(name.size());
  const std::size_t needed = sizeof(length) + name.size();
  if (blocks_.empty() || blocks_.back().size() + needed > blocks_.back().capacity()) {
    blocks_.emplace_back().reserve(std::max(kBlock, needed));
  }
  std::string& block = blocks_.back();
  const std::uint64_t position = (std::uint64_t{blocks_.size() - 1} << kBlockBits) | block.size();
  block.append(reinterpret_cast<const char*>(&length), sizeof(length)).append(name);
  return position;
}

void PathTable::grow() {
  std::vector<std::uint32_t>(std::max(kFirstSlots, 2 * slots_.size())).swap(slots_);
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    std::size_t slot = entries_[i].hash & (slots_.size() - 1);
    while (slots_[slot] != 0) slot = (slot + 1) & (slots_.size() - 1);
    slots_[slot] = static_cast<std::uint32_t>(i + 1);
  }
}

std::vector<std::uint32_t> PathTable::sorted() const {
  std::vector<std::uint32_t> numbers(entries_.size());
  std::iota(numbers.begin(), numbers.end(), std::uint32_t{0});
  // A folder's text ends with '/', so two paths of different folders compare as texts.
  std::sort(numbers.begin(), numbers.end(), [this](std::uint32_t a, std::uint32_t b) {
    if (entries_[a].folder == entries_[b].folder) return name(a) < name(b);
    return path(a) < path(b);
  });
  return numbers;
}

}  // namespace q3d::manifests
