#include "loaders/formats/picture_name.h"

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>

namespace q3d::loaders::formats {
namespace {

namespace fs = std::filesystem;

bool is_letter(char c) {
  return std::isalpha(static_cast<unsigned char>(c)) != 0;
}

// Removes "C:" from the front, also where a '/' precedes it, as in file:///C:/a.jpg.
bool drop_drive(std::string_view& text) {
  const std::size_t at = text.starts_with('/') ? 1 : 0;
  if (text.size() < at + 2 || !is_letter(text[at]) || text[at + 1] != ':') return false;
  text.remove_prefix(at + 2);
  return true;
}

void drop_component(std::string_view& text) {
  text.remove_prefix(std::min(text.find('/'), text.size()));
}

// Removes "https://host" or "file://host" from the front.
bool drop_scheme(std::string_view& text) {
  const std::size_t colon = text.find(':');
  if (colon == std::string_view::npos || colon < 2 || !is_letter(text[0])) return false;  // "C:" is a drive
  const bool is_scheme =
      std::all_of(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(colon), [](char c) {
        return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '+' || c == '-' || c == '.';
      });
  const bool has_host = text.substr(colon + 1).starts_with("//");
  if (!is_scheme || (!has_host && text.substr(0, colon) != "file")) return false;
  text.remove_prefix(colon + 1);
  if (has_host) {
    text.remove_prefix(2);
    drop_component(text);
  }
  return true;
}

// Removes the two folders that a Windows name may begin with: \\server\share, or \\?\ for long names.
bool drop_share(std::string_view& text) {
  if (!text.starts_with("//")) return false;
  if (text.starts_with("//?/") || text.starts_with("//./")) {
    text.remove_prefix(3);
    return true;
  }
  text.remove_prefix(2);
  drop_component(text);
  if (!text.empty()) text.remove_prefix(1);
  drop_component(text);
  return true;
}

// Decodes %20 and the like. Returns nothing if there is nothing to decode.
std::optional<std::string> decoded(std::string_view text) {
  std::string result;
  bool has_any = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    unsigned value = 0;
    if (text[i] == '%' && i + 2 < text.size()) {
      const char* first = text.data() + i + 1;
      if (const auto [end, error] = std::from_chars(first, first + 2, value, 16);
          error == std::errc() && end == first + 2 && value != 0) {
        result += static_cast<char>(value);
        i += 2;
        has_any = true;
        continue;
      }
    }
    result += text[i];
  }
  return has_any ? std::optional(result) : std::nullopt;
}

// Spreadsheets and scripts leave spaces around a name.
std::string_view trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(" \t\r\n") - first + 1);
}

void add(std::vector<NameReading>& readings, NameReading reading) {
  if (reading.path.empty()) return;
  const bool is_known = std::any_of(readings.begin(), readings.end(), [&](const NameReading& each) {
    return each.path == reading.path && each.is_absolute == reading.is_absolute;
  });
  if (!is_known) readings.push_back(std::move(reading));
}

NameReading reading_of(std::string_view text, bool is_absolute) {
  fs::path normal = fs::path(text).lexically_normal();
  const bool begins_at_root = normal.is_absolute();
  if (begins_at_root) normal = normal.relative_path();
  while (is_absolute && climbs_out(normal)) normal = normal.lexically_relative("..");
  return {std::move(normal), is_absolute || begins_at_root, begins_at_root && !is_absolute};
}

// A name without its drive, share, scheme, host and query, in which backslashes have become '/'.
struct PlainName {
  std::string path;
  std::string query;
  bool is_absolute = false;
};

PlainName plain_name(std::string_view name) {
  std::string slashed(name);
  std::replace(slashed.begin(), slashed.end(), '\\', '/');
  std::string_view rest = slashed;
  PlainName plain;
  const bool is_url = drop_scheme(rest);
  if (is_url) rest = rest.substr(0, rest.find('#'));
  const std::size_t mark = rest.starts_with("//?/") ? std::string_view::npos : rest.find('?');
  if (mark != std::string_view::npos && (is_url || rest.find('=', mark) != std::string_view::npos)) {
    plain.query = rest.substr(mark + 1);
    rest = rest.substr(0, mark);
  }
  const bool had_share = !is_url && name.starts_with("\\\\") && drop_share(rest);
  const bool had_drive = drop_drive(rest);
  plain.is_absolute = is_url || had_share || had_drive;
  plain.path = rest;
  return plain;
}

// Returns the values of a query that look like a picture's path.
std::vector<std::string> paths_in_query(std::string_view query) {
  std::vector<std::string> paths;
  while (!query.empty()) {
    const std::string_view field = query.substr(0, query.find('&'));
    query.remove_prefix(std::min(field.size() + 1, query.size()));
    const std::string_view value = field.substr(std::min(field.find('=') + 1, field.size()));
    const std::string path = decoded(value).value_or(std::string(value));
    if (path.find('.') != std::string::npos) paths.push_back(path);
  }
  return paths;
}

}  // namespace

bool climbs_out(const fs::path& normal) {
  return !normal.empty() && *normal.begin() == "..";
}

std::vector<NameReading> readings_of(std::string_view name) {
  std::vector<NameReading> readings;
  add(readings, reading_of(name, false));
  const PlainName plain = plain_name(name);
  add(readings, reading_of(plain.path, plain.is_absolute));
  for (const std::string& path : paths_in_query(plain.query)) add(readings, reading_of(path, true));
  add(readings, reading_of(trimmed(plain.path), plain.is_absolute));
  if (const auto text = decoded(plain.path)) {
    const PlainName again = plain_name(*text);  // %5C is a backslash
    add(readings, reading_of(again.path, plain.is_absolute || again.is_absolute));
  }
  return readings;
}

std::string id_part(std::string_view name) {
  const PlainName plain = plain_name(name);
  const NameReading reading = reading_of(plain.path, plain.is_absolute);
  const bool is_base_name = reading.is_absolute || climbs_out(reading.path);
  std::string part = is_base_name ? reading.path.filename().string() : reading.path.generic_string();
  std::replace_if(
      part.begin(), part.end(), [](unsigned char c) { return c < 0x20 || c == 0x7f; }, '_');
  return part;
}

}  // namespace q3d::loaders::formats
