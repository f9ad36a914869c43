#include <fmt/format.h>

#include <charconv>
#include <chrono>
#include <optional>

#include "manifests/atomic_file.h"
#include "manifests/block_reader.h"
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

// One line of the cache's file. `path` points into the text of the line.
struct CachedDigest {
  DigestBytes sha256{};
  FileState state;
  std::string_view path;
};

// Calls `take` for every sound line of the file. Returns whether there is such a file and all its lines are
// sound.
template <typename Take>
bool read_cached(const std::filesystem::path& file, Take&& take) {
  if (!std::filesystem::exists(file)) return false;
  bool is_sound = true;
  LineReader lines(file);
  while (const auto text = lines.next()) {
    const auto payload = open_line(*text);
    if (!payload) {
      is_sound = false;
      continue;
    }
    std::string_view fields = *payload;
    CachedDigest line;
    const auto sha256 = digest_from_hex(next_field(fields, ' '));
    if (sha256 && parse(next_field(fields, ' '), line.state.size) &&
        parse(next_field(fields, ' '), line.state.mtime_ns) &&
        parse(next_field(fields, ' '), line.state.inode) && !fields.empty()) {
      line.sha256 = *sha256;
      line.path = fields;
      take(line);
    } else {
      is_sound = false;
    }
  }
  return is_sound;
}

// Returns the path in the form in which it is remembered: absolute and without detours. Most paths are
// already in this form.
std::string key_of(const std::filesystem::path& path) {
  const std::string& text = path.native();
  const bool has_detours = text.find("//") != std::string::npos || text.find("/.") != std::string::npos;
  if (text.starts_with('/') && !has_detours) return text;
  return std::filesystem::absolute(path).lexically_normal().string();
}

}  // namespace

DigestCache::DigestCache(std::filesystem::path file) : file_(std::move(file)) {
  is_saved_ = read_cached(file_, [this](const CachedDigest& line) {
    remember(line.path, {line.state.size, line.state.mtime_ns, line.state.inode, line.sha256});
  });
}

std::multimap<std::string, std::filesystem::path> read_known_files(const std::filesystem::path& digests) {
  std::multimap<std::string, std::filesystem::path> files;
  read_cached(digests, [&](const CachedDigest& line) { files.emplace(to_hex(line.sha256), line.path); });
  return files;
}

void DigestCache::remember(std::string_view path, const Entry& entry) {
  const auto [number, is_new] = paths_.add(path);
  if (is_new) entries_.emplace_back();
  entries_[number] = entry;
}

std::string DigestCache::digest(const std::filesystem::path& path) {
  const std::string key = key_of(path);
  const FileState before = state_of(path);
  {
    const std::lock_guard lock(mutex_);
    if (const auto number = paths_.find(key)) {
      const Entry& entry = entries_[*number];
      if (entry.inode != 0 && FileState{entry.size, entry.mtime_ns, entry.inode} == before) {
        return to_hex(entry.sha256);
      }
    }
  }
  const std::int64_t started_ns = now_ns();
  std::string digest = sha256_file(path);
  const bool settled = before.mtime_ns < started_ns - kRacyNs && state_of(path) == before;
  const bool fits_a_line = key.find('\n') == std::string::npos;
  const std::lock_guard lock(mutex_);
  if (settled && fits_a_line) {
    remember(key, {before.size, before.mtime_ns, before.inode, digest_from_hex(digest).value()});
    is_saved_ = false;
  } else if (const auto number = paths_.find(key)) {
    entries_[*number] = {};
    is_saved_ = false;
  }
  return digest;
}

std::optional<std::string> DigestCache::digest_if_present(const std::filesystem::path& path) {
  return if_present([&] { return digest(path); });
}

void DigestCache::save() const {
  const std::lock_guard lock(mutex_);
  if (is_saved_) return;
  AtomicWriter file(file_);
  for (const std::uint32_t number : paths_.sorted()) {
    const Entry& entry = entries_[number];
    if (entry.inode == 0) continue;
    file.write(seal_line(fmt::format("{} {} {} {} {}", to_hex(entry.sha256), entry.size, entry.mtime_ns,
                                     entry.inode, paths_.path(number))));
  }
  file.commit();
  is_saved_ = true;
}

}  // namespace q3d::manifests
