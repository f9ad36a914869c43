#include "manifests/text_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cstdint>
#include <span>
#include <stdexcept>
#include <utility>

#include "manifests/file_descriptor.h"

namespace q3d::manifests {
namespace {

using namespace std::string_view_literals;

constexpr std::string_view kUtf8Mark = "\xef\xbb\xbf"sv;

struct Signature {
  std::string_view start;
  std::string_view meaning;
};
constexpr std::array<Signature, 8> kSignatures{
    {{"version https://git-lfs", "a Git LFS pointer, which stands for the file: run `git lfs pull`"},
     {"PK\3\4",
      "a ZIP archive, such as an .xlsx workbook or a packed export: unpack it, or save the sheet as CSV"},
     {"\x1f\x8b", "a gzip archive: unpack it"},
     {"\x89HDF\r\n", "an HDF5 file"},
     {"%PDF", "a PDF document"},
     {"\x89PNG", "a PNG picture"},
     {"\xff\xd8\xff", "a JPEG picture"},
     {"\x80", "a Python pickle: save the labels as CSV, HDF5 or JSON"}}};

std::string_view without_leading_space(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t\r\n");
  return first == std::string_view::npos ? std::string_view() : text.substr(first);
}

// Names an HTML or XML page. Web servers send one when a download needs a login, has moved or has used up its
// quota.
std::string named_markup(std::string_view content) {
  constexpr std::size_t kShown = 1024;
  std::string start(content.substr(0, kShown));
  std::transform(start.begin(), start.end(), start.begin(), [](unsigned char c) { return std::tolower(c); });
  const bool is_xml = start.starts_with("<?xml") || start.starts_with("<annotation");
  if (is_xml && start.find("<html") == std::string::npos) {
    return start.find("<annotations>") == std::string::npos
               ? "an XML file, such as Pascal VOC's: export the labels as COCO Keypoints instead"
               : "an XML file as CVAT writes it: export the task as COCO Keypoints instead";
  }
  return "an HTML page (a web page that was saved in the place of the file): download the file again";
}

void append_utf8(char32_t code, std::string& text) {
  const auto tail = [&](unsigned shift) { text += static_cast<char>(0x80U | ((code >> shift) & 0x3fU)); };
  if (code < 0x80) {
    text += static_cast<char>(code);
  } else if (code < 0x800) {
    text += static_cast<char>(0xc0U | (code >> 6U));
    tail(0);
  } else if (code < 0x10000) {
    text += static_cast<char>(0xe0U | (code >> 12U));
    tail(6);
    tail(0);
  } else {
    text += static_cast<char>(0xf0U | (code >> 18U));
    tail(12);
    tail(6);
    tail(0);
  }
}

// Converts UTF-16 without its byte order mark. An unpaired surrogate becomes U+FFFD.
std::string utf8_from_utf16(std::string_view bytes, bool is_big_endian) {
  std::string text;
  text.reserve(bytes.size() / 2);
  const auto unit = [&](std::size_t i) {
    const auto first = static_cast<unsigned char>(bytes[i]);
    const auto second = static_cast<unsigned char>(bytes[i + 1]);
    return static_cast<char32_t>(is_big_endian ? first << 8U | second : second << 8U | first);
  };
  for (std::size_t i = 0; i + 1 < bytes.size(); i += 2) {
    char32_t code = unit(i);
    const bool is_first_half = code >= 0xd800 && code < 0xdc00;
    const char32_t next = is_first_half && i + 3 < bytes.size() ? unit(i + 2) : 0;
    if (next >= 0xdc00 && next < 0xe000) {
      code = 0x10000 + ((code - 0xd800) << 10U) + (next - 0xdc00);
      i += 2;
    } else if (code >= 0xd800 && code < 0xe000) {
      code = 0xfffd;
    }
    append_utf8(code, text);
  }
  return text;
}

std::string read_whole(const std::filesystem::path& path, std::string_view expected,
                       std::uint64_t max_bytes) {
  try {
    return read_input(path, [&](const FileDescriptor& file) {
      const std::uint64_t size = file.size();
      if (size > max_bytes) {
        throw std::runtime_error(fmt::format("{}: got {} bytes, expected {} of at most {}", path.string(),
                                             size, expected, max_bytes));
      }
      std::string text(size, '\0');
      file.read_at(0, std::as_writable_bytes(std::span(text)));
      return text;
    });
  } catch (const IoError& error) {
    if (!error.names_no_file()) throw;
    throw std::runtime_error(fmt::format("{}: {}, expected {}", path.string(), error.reason(), expected));
  }
}

}  // namespace

std::string named_content(std::string_view content) {
  if (content.starts_with(kUtf8Mark)) content.remove_prefix(kUtf8Mark.size());
  if (content.empty()) return "an empty file (0 bytes)";
  for (const Signature& each : kSignatures) {
    if (content.starts_with(each.start)) return std::string(each.meaning);
  }
  const std::string_view text = without_leading_space(content);
  if (text.empty()) return "a file without any text";
  return text.starts_with('<') ? named_markup(text) : std::string();
}

std::string read_text_file(const std::filesystem::path& file, std::string_view expected,
                           std::uint64_t max_bytes) {
  std::string text = read_whole(file, expected, max_bytes);
  if (text.starts_with("\xff\xfe"sv) || text.starts_with("\xfe\xff"sv)) {
    text = utf8_from_utf16(std::string_view(text).substr(2), text.starts_with("\xfe"sv));
  }
  if (text.starts_with(kUtf8Mark)) text.erase(0, kUtf8Mark.size());
  std::string named = named_content(text);
  constexpr std::size_t kSearched = 1024;
  if (named.empty() && std::string_view(text).substr(0, kSearched).find('\0') != std::string_view::npos) {
    named = "a file with zero bytes, which is no text in UTF-8: save it with the encoding UTF-8";
  }
  if (named.empty()) return text;
  throw std::runtime_error(fmt::format("{}: got {}; expected {}", file.string(), named, expected));
}

}  // namespace q3d::manifests
