#include <fmt/format.h>

#include <charconv>
#include <chrono>
#include <optional>

#include "manifests/atomic_file.h"
#include "manifests/checked_line.h"
#include "manifests/digest.h"
#include "manifests/file_descriptor.h"
#include "manifests/file_stamp.h"
#include "manifests/known_files.h"
#include "manifests/next_field.h"

namespace q3d::manifests {
namespace {

constexpr std::int64_t kRacyNs = 2 * kNsPerSecond;  // FAT's mtime ticks every two seconds

struct FileState {
  std::uint64_t size = 0;
  std::int64_t mtime_ns = 0;
  std::uint64_t inode = 0;
  bool operator==(const FileState&) const = default;
};

FileState state_of(const std::filesystem::path& path) {
  const auto stamp = stamp_of(path);
  if (!stamp) throw_errno("inspect", path);
  return {stamp->size, stamp->mtime_ns, stamp->inode};
}

std::int64_t now_ns() {
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::nanoseconds>(now).count();
}

template <typename Integer>
bool parse(std::string_view text, Integer& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size();
}

// One line of the cache's file.
struct CachedDigest {
  std::string sha256;
  FileState state;
  std::string path;
};

// Calls `take` for every sound line of the file; none if there is no such file.
template <typename Take>
void read_cached(const std::filesystem::path& file, Take&& take) {
  if (!std::filesystem::exists(file)) return;
  const std::string content = read_file(file);
  std::string_view rest = content;
  while (!rest.empty()) {
    const auto payload = open_line(next_field(rest, '\n'));
    if (!payload) continue;
    std::string_view fields = *payload;
    CachedDigest line;
    line.sha256 = next_field(fields, ' ');
    if (line.sha256.size() == 64 && parse(next_field(fields, ' '), line.state.size) &&
        parse(next_field(fields, ' '), line.state.mtime_ns) &&
        parse(next_field(fields, ' '), line.state.inode) && !fields.empty()) {
      line.path = fields;
      take(std::move(line));
    }
  }
}

}  // namespace

DigestCache::DigestCache(std::filesystem::path file) : file_(std::move(file)) {
  read_cached(file_, [this](CachedDigest line) {
    entries_.insert_or_assign(std::move(line.path), Entry{line.state.size, line.state.mtime_ns,
                                                          line.state.inode, std::move(line.sha256)});
  });
}

std::multimap<std::string, std::filesystem::path> read_known_files(const std::filesystem::path& digests) {
  std::multimap<std::string, std::filesystem::path> files;
  read_cached(digests,
              [&](CachedDigest line) { files.emplace(std::move(line.sha256), std::move(line.path)); });
  return files;
}

std::string DigestCache::digest(const std::filesystem::path& path) {
  const std::string key = std::filesystem::absolute(path).lexically_normal().string();
  const FileState before = state_of(path);
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(key);
    if (found != entries_.end()) {
      const Entry& entry = found->second;
      if (FileState{entry.size, entry.mtime_ns, entry.inode} == before) return entry.sha256;
    }
  }
  const std::int64_t started_ns = now_ns();
  std::string digest = sha256_file(path);
  const bool settled = before.mtime_ns < started_ns - kRacyNs && state_of(path) == before;
  const bool fits_a_line = key.find('\n') == std::string::npos;
  const std::lock_guard lock(mutex_);
  if (settled && fits_a_line) {
    entries_.insert_or_assign(key, Entry{before.size, before.mtime_ns, before.inode, digest});
  } else {
    entries_.erase(key);
  }
  return digest;
}

std::optional<std::string> DigestCache::digest_if_present(const std::filesystem::path& path) {
  try {
    return digest(path);
  } catch (const IoError& error) {
    if (error.names_no_file()) return std::nullopt;
    throw;
  }
}

void DigestCache::save() const {
  std::string content;
  {
    const std::lock_guard lock(mutex_);
    for (const auto& [path, entry] : entries_) {
      content += seal_line(
          fmt::format("{} {} {} {} {}", entry.sha256, entry.size, entry.mtime_ns, entry.inode, path));
    }
  }
  write_file_atomically(file_, content);
}

}  // namespace q3d::manifests
