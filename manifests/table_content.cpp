#include "manifests/table_content.h"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace q3d::manifests {

TableContent::TableContent(const std::filesystem::path& path)
    : path_(path), file_(std::make_unique<ReopenedFile>(path)) {}

TableContent::TableContent(std::filesystem::path path, std::vector<std::byte> bytes)
    : path_(std::move(path)), bytes_(std::move(bytes)) {}

std::uint64_t TableContent::size() const {
  return file_ ? file_->size() : bytes_.size();
}

void TableContent::read_at(std::uint64_t offset, std::span<std::byte> bytes) const {
  if (file_) {
    file_->read_at(offset, bytes);
    return;
  }
  if (offset > bytes_.size() || bytes.size() > bytes_.size() - offset) {
    throw IoError("read", path_,
                  fmt::format("{} bytes from byte {} on of {}", bytes.size(), offset, bytes_.size()), 0);
  }
  std::copy_n(bytes_.begin() + static_cast<std::ptrdiff_t>(offset), bytes.size(), bytes.begin());
}

std::optional<std::span<const std::byte>> TableContent::in_memory() const {
  if (file_) return std::nullopt;
  return bytes_;
}

}  // namespace q3d::manifests
