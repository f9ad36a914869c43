#include "manifests/journal.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string_view>

#include "manifests/atomic_file.h"
#include "manifests/checked_line.h"
#include "manifests/file_descriptor.h"
#include "manifests/file_name.h"
#include "manifests/json_number.h"
#include "manifests/json_parse.h"

namespace q3d::manifests {
namespace {

// A unit that left no file has an empty name.
bool stays_in_folder(const std::string& file) {
  return file.empty() || leads_below(file);
}

std::string to_payload(const JournalEntry& entry) {
  return nlohmann::ordered_json{{"unit", entry.unit},     {"input", entry.input_digest}, {"file", entry.file},
                                {"sha256", entry.sha256}, {"bytes", entry.bytes},        {"rows", entry.rows}}
      .dump();
}

// Returns nothing if the line is not a complete journal line.
std::optional<JournalEntry> parse_line(std::string_view line) {
  const auto payload = open_line(line);
  if (!payload) return std::nullopt;
  try {
    const auto json = parse_json<nlohmann::json>(*payload);
    constexpr std::int64_t kLeast = std::numeric_limits<std::int64_t>::min();
    JournalEntry entry{whole_number_at(json, "unit", kLeast),  json.at("input").get<std::string>(),
                       json.at("file").get<std::string>(),     json.at("sha256").get<std::string>(),
                       whole_number_at(json, "bytes", kLeast), whole_number_at(json, "rows", kLeast)};
    if (!stays_in_folder(entry.file)) return std::nullopt;
    return entry;
  } catch (const nlohmann::json::exception&) {
    return std::nullopt;
  } catch (const std::runtime_error&) {  // too deep, a key twice, or a number that is none
    return std::nullopt;
  }
}

}  // namespace

Journal::Journal(std::filesystem::path file) : file_(std::move(file)) {
  if (!std::filesystem::exists(file_)) return;
  const std::string content = read_file(file_);
  file_bytes_ = content.size();
  std::string sound_lines;
  std::int64_t line_number = 0;
  for (std::size_t at = 0; at < content.size();) {
    ++line_number;
    const std::size_t end = content.find('\n', at);
    const std::size_t next = end == std::string::npos ? content.size() : end + 1;
    auto entry =
        end == std::string::npos ? std::nullopt : parse_line(std::string_view(content).substr(at, end - at));
    if (entry) {
      sound_lines.append(content, at, next - at);
      const std::int64_t unit = entry->unit;
      entries_.insert_or_assign(unit, std::move(*entry));
    } else if (next == content.size()) {
      dropped_torn_line_ = true;  // the last line, which a killed writer did not finish
    } else {
      damaged_lines_.push_back(line_number);
    }
    at = next;
  }
  whole_bytes_ = sound_lines.size();
  if (!damaged_lines_.empty()) sound_lines_ = std::move(sound_lines);
}

std::optional<JournalEntry> Journal::find(std::int64_t unit, const std::string& input_digest) const {
  const auto found = entries_.find(unit);
  if (found == entries_.end() || found->second.input_digest != input_digest) return std::nullopt;
  return found->second;
}

void Journal::repair() {
  if (!sound_lines_) return;
  write_file_atomically(file_, *sound_lines_);
  file_bytes_ = sound_lines_->size();
  sound_lines_.reset();
}

void Journal::write_anew() {
  std::string lines;
  for (const auto& [unit, entry] : entries_) lines += seal_line(to_payload(entry));
  write_file_atomically(file_, lines);
  whole_bytes_ = file_bytes_ = lines.size();
  sound_lines_.reset();
}

void Journal::append(const JournalEntry& entry) {
  if (!stays_in_folder(entry.file)) {
    throw std::invalid_argument(fmt::format("{}: a journal entry's file must stay in the folder, got {}",
                                            file_.string(), entry.file));
  }
  const std::string line = seal_line(to_payload(entry));
  const bool is_new = !std::filesystem::exists(file_);
  const std::uint64_t bytes_now = is_new ? 0 : std::filesystem::file_size(file_);
  if (bytes_now != file_bytes_) {
    throw std::runtime_error(
        fmt::format("{}: grew from {} to {} bytes behind this process's back. Another build "
                    "writes it: end one of the two.",
                    file_.string(), file_bytes_, bytes_now));
  }
  repair();
  FileDescriptor file(file_, O_WRONLY | O_CREAT | O_APPEND);
  const auto cut = [&] { return ::ftruncate(file.get(), static_cast<off_t>(whole_bytes_)) == 0; };
  if (file_bytes_ != whole_bytes_ && !cut()) throw_errno("cut a torn line off", file_);
  try {
    file.write_all(line);
    file.sync();
    file.close();
    if (is_new) sync_folder(file_.parent_path());
  } catch (...) {
    if (file.get() >= 0 && cut()) file_bytes_ = whole_bytes_;
    throw;
  }
  whole_bytes_ += line.size();
  file_bytes_ = whole_bytes_;
  entries_.insert_or_assign(entry.unit, entry);
}

}  // namespace q3d::manifests
