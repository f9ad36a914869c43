#include "manifests/block_reader.h"

#include <algorithm>
#include <utility>

namespace q3d::manifests {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 18U;

}  // namespace

std::size_t BlockReader::read(std::span<char> bytes) {
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), size() - at_));
  file_.read_at(at_, std::as_writable_bytes(bytes.first(count)));
  at_ += count;
  return count;
}

std::optional<std::string_view> LineReader::next() {
  for (std::size_t searched = at_;;) {
    const std::size_t end = text_.find('\n', searched);
    if (end != std::string::npos) {
      const std::string_view line = std::string_view(text_).substr(at_, end - at_);
      at_ = end + 1;
      return line;
    }
    if (is_read_) break;
    text_.erase(0, at_);
    at_ = 0;
    searched = text_.size();
    text_.resize(searched + kBlock);
    const std::size_t count = file_.read(std::span(text_).subspan(searched));
    text_.resize(searched + count);
    is_read_ = count < kBlock;
  }
  if (at_ == text_.size()) return std::nullopt;
  was_whole_ = false;
  return std::string_view(text_).substr(std::exchange(at_, text_.size()));
}

}  // namespace q3d::manifests
