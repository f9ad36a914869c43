#include "manifests/block_reader.h"

#include <algorithm>
#include <cerrno>
#include <utility>

namespace q3d::manifests {
namespace {

constexpr std::size_t kBlock = std::size_t{1} << 18U;

}  // namespace

BlockReader::BlockReader(std::filesystem::path path)
    : path_(std::move(path)), file_(open_input(path_)), stamp_(stamp_of(file_)) {}

std::size_t BlockReader::read(std::span<char> bytes) {
  const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(bytes.size(), size() - at_));
  for (int attempt = 0;; ++attempt) {
    try {
      file_.read_at(at_, std::as_writable_bytes(bytes.first(count)));
      at_ += count;
      return count;
    } catch (const IoError& error) {
      if (error.code() != ESTALE || !pause_before_retry(ESTALE, attempt)) throw;
    }
    FileDescriptor again = open_input(path_);
    if (stamp_of(again) != stamp_) {
      throw IoError("read", path_, "it has changed while it was read: run again", ESTALE);
    }
    file_ = std::move(again);
  }
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
