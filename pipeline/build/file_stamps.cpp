#include "pipeline/build/file_stamps.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <stdexcept>
#include <string_view>
#include <system_error>

#include "manifests/next_field.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using manifests::FileStamp;
using manifests::next_field;
using manifests::stamp_of;

constexpr std::string_view kAbsent = "absent";

template <typename Integer>
Integer number(std::string_view text) {
  Integer value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || text.empty()) {
    throw std::invalid_argument(fmt::format("a file's stamp: got '{}', expected a number", text));
  }
  return value;
}

}  // namespace

std::vector<StampedFile> stamp_files(std::vector<std::string> paths) {
  std::sort(paths.begin(), paths.end());
  paths.erase(std::unique(paths.begin(), paths.end()), paths.end());
  std::vector<StampedFile> files(paths.size());
  tbb::parallel_for(std::size_t{0}, paths.size(), [&](std::size_t i) {
    files[i].stamp = stamp_of(paths[i]);
    files[i].path = std::move(paths[i]);
  });
  return files;
}

bool have_stamps(const std::vector<StampedFile>& files) {
  std::atomic<bool> all = true;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, files.size(), 256),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end() && all; ++i) {
                        if (stamp_of(files[i].path) != files[i].stamp) all = false;
                      }
                    });
  return all;
}

std::int64_t newest_change_ns(const std::vector<StampedFile>& files) {
  std::int64_t newest = 0;
  for (const StampedFile& file : files) {
    if (file.stamp) newest = std::max({newest, file.stamp->mtime_ns, file.stamp->ctime_ns});
  }
  return newest;
}

std::optional<std::vector<std::string>> folders_below(const fs::path& folder, const fs::path& except,
                                                      std::size_t most) {
  std::vector<std::string> folders{folder.string()};
  std::error_code error;
  std::size_t seen = 0;
  for (fs::recursive_directory_iterator entry(folder, error), end; !error && entry != end;
       entry.increment(error)) {
    if (++seen > most) return std::nullopt;
    if (!entry->is_directory(error) || entry->is_symlink(error)) continue;
    if (entry->path() == except) {
      entry.disable_recursion_pending();
    } else {
      folders.push_back(entry->path().string());
    }
  }
  if (error) return std::nullopt;  // a folder that cannot be listed: nothing can be said of it
  return folders;
}

std::optional<std::string> to_text(std::vector<StampedFile> files) {
  // Stable, so that equal lists give equal text also where a path is in them twice.
  std::stable_sort(files.begin(), files.end(),
                   [](const StampedFile& a, const StampedFile& b) { return a.path < b.path; });
  std::string text;
  for (const StampedFile& file : files) {
    if (file.path.find('\n') != std::string::npos) return std::nullopt;
    if (!file.stamp) {
      text += fmt::format("{} {}\n", kAbsent, file.path);
      continue;
    }
    const FileStamp& stamp = *file.stamp;
    text += fmt::format("{} {} {} {} {} {}\n", stamp.size, stamp.mtime_ns, stamp.ctime_ns, stamp.inode,
                        stamp.device, file.path);
  }
  return text;
}

std::vector<StampedFile> stamps_from_text(std::string_view text) {
  std::vector<StampedFile> files;
  while (!text.empty()) {
    std::string_view line = next_field(text, '\n');
    StampedFile& file = files.emplace_back();
    const std::string_view first = next_field(line, ' ');
    if (first != kAbsent) {
      FileStamp stamp;
      stamp.size = number<std::uint64_t>(first);
      stamp.mtime_ns = number<std::int64_t>(next_field(line, ' '));
      stamp.ctime_ns = number<std::int64_t>(next_field(line, ' '));
      stamp.inode = number<std::uint64_t>(next_field(line, ' '));
      stamp.device = number<std::uint64_t>(next_field(line, ' '));
      file.stamp = stamp;
    }
    file.path = line;
  }
  return files;
}

}  // namespace q3d::pipeline::build
