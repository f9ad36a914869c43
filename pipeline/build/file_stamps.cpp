#include "pipeline/build/file_stamps.h"

#include <fmt/format.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <iterator>
#include <string_view>
#include <system_error>

#include "manifests/next_field.h"

namespace q3d::pipeline::build {
namespace {

namespace fs = std::filesystem;
using manifests::FileStamp;
using manifests::next_field;
using manifests::stamp_of;

// The first character of a line is one of these.
constexpr char kFolder = '/';
constexpr char kAbsent = '-';
constexpr char kPresent = '+';

template <typename Integer>
bool take_number(std::string_view& line, Integer& value) {
  const std::string_view text = next_field(line, ' ');
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() && !text.empty();
}

}  // namespace

std::vector<StampedFile> stamp_files(std::vector<std::string> paths) {
  std::vector<StampedFile> files(paths.size());
  tbb::parallel_for(std::size_t{0}, paths.size(), [&](std::size_t i) {
    files[i].stamp = stamp_of(paths[i]);
    files[i].path = std::move(paths[i]);
  });
  return files;
}

bool have_stamps(std::span<const StampedFile> files) {
  std::atomic<bool> all = true;
  tbb::parallel_for(tbb::blocked_range<std::size_t>(0, files.size(), 256),
                    [&](const tbb::blocked_range<std::size_t>& range) {
                      for (std::size_t i = range.begin(); i < range.end() && all; ++i) {
                        if (stamp_of(files[i].path) != files[i].stamp) all = false;
                      }
                    });
  return all;
}

std::int64_t newest_change_ns(std::span<const StampedFile> files) {
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
  if (error) return std::nullopt;  // a folder that cannot be listed
  return folders;
}

bool StampWriter::append(std::span<const StampedFile> files, std::string& text) {
  const auto into = std::back_inserter(text);
  for (const StampedFile& file : files) {
    if (file.path.find('\n') != std::string::npos) return false;
    const std::string_view path = file.path;
    const std::string_view folder = path.substr(0, path.rfind('/') + 1);
    if (folder != folder_) {
      folder_ = folder;
      fmt::format_to(into, "{} {}\n", kFolder, folder);
    }
    const std::string_view name = path.substr(folder.size());
    if (!file.stamp) {
      fmt::format_to(into, "{} {}\n", kAbsent, name);
      continue;
    }
    const FileStamp& stamp = *file.stamp;
    fmt::format_to(into, "{} {} {} {} {} {} {}\n", kPresent, stamp.size, stamp.mtime_ns, stamp.ctime_ns,
                   stamp.inode, stamp.device, name);
  }
  return true;
}

bool StampReader::read(std::string_view line, std::vector<StampedFile>& files) {
  const std::string_view kind = next_field(line, ' ');
  if (kind.size() != 1) return false;
  if (kind[0] == kFolder) {
    folder_ = line;
    return true;
  }
  std::optional<FileStamp> stamp;
  if (kind[0] == kPresent) {
    stamp.emplace();
    const bool is_whole = take_number(line, stamp->size) && take_number(line, stamp->mtime_ns) &&
                          take_number(line, stamp->ctime_ns) && take_number(line, stamp->inode) &&
                          take_number(line, stamp->device);
    if (!is_whole) return false;
  } else if (kind[0] != kAbsent) {
    return false;
  }
  StampedFile& file = files.emplace_back();
  file.path.reserve(folder_.size() + line.size());
  file.path.append(folder_).append(line);
  file.stamp = stamp;
  return true;
}

}  // namespace q3d::pipeline::build
