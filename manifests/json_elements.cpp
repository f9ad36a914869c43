#include "manifests/json_elements.h"

#include <algorithm>
#include <cstddef>
#include <iterator>
#include <optional>
#include <stdexcept>
#include <string_view>
#include <utility>

#include "manifests/block_reader.h"
#include "manifests/json_file.h"
#include "manifests/json_mask.h"
#include "manifests/json_parse.h"
#include "manifests/text_file.h"

namespace q3d::manifests {
namespace {

using nlohmann::json;
using namespace std::string_view_literals;

constexpr std::size_t kBlock = std::size_t{1} << 18U;

// The text of a file in UTF-8, block by block, with the numbers that JSON cannot hold masked.
class JsonText {
 public:
  explicit JsonText(const std::filesystem::path& file) : file_(file) { fill(); }

  std::uint64_t bytes() const { return file_.size(); }
  // The text that has been read and masked, from the place up to which it was used.
  std::string_view text() const { return std::string_view(text_).substr(at_, masked_ - at_); }

  // Whether the first block can be read as it is. It cannot if it is in another encoding or is no JSON. The
  // file is then read as a whole, which converts it or reports what it is.
  bool is_plain() const {
    constexpr std::size_t kSearched = 1024;
    return !text().starts_with("\xff\xfe"sv) && !text().starts_with("\xfe\xff"sv) &&
           text().substr(0, kSearched).find('\0') == std::string_view::npos && named_content(text()).empty();
  }
  void skip_mark() {
    if (text().starts_with("\xef\xbb\xbf"sv)) at_ += 3;
  }

  bool is_at_end() { return at_ == masked_ && !fill(); }
  const char& front() const { return text_[at_]; }
  void pop() { ++at_; }

 private:
  // Reads on until more of the text is masked. Returns false at the end of the file.
  bool fill() {
    text_.erase(0, at_);
    masked_ -= at_;
    at_ = 0;
    while (at_ == masked_ && !is_read_) {
      const std::size_t had = text_.size();
      text_.resize(had + kBlock);
      const std::size_t count = file_.read(std::span(text_).subspan(had));
      text_.resize(had + count);
      is_read_ = count < kBlock;
      masked_ = mask_.apply(text_, masked_, is_read_);
    }
    return at_ < masked_;
  }

  BlockReader file_;
  JsonMask mask_;
  std::string text_;
  std::size_t at_ = 0;
  std::size_t masked_ = 0;
  bool is_read_ = false;
};

// The characters of a text for nlohmann's parser.
class Characters {
 public:
  using iterator_category = std::input_iterator_tag;
  using value_type = char;
  using difference_type = std::ptrdiff_t;
  using pointer = const char*;
  using reference = const char&;

  Characters() = default;  // the end
  explicit Characters(JsonText& text) : text_(text.is_at_end() ? nullptr : &text) {}

  reference operator*() const { return text_->front(); }
  Characters& operator++() {
    text_->pop();
    if (text_->is_at_end()) text_ = nullptr;
    return *this;
  }
  bool operator==(const Characters&) const = default;

 private:
  JsonText* text_ = nullptr;
};

json parsed(JsonText& text, const std::string& key, const std::function<void(json&&)>& take) {
  JsonBuilder<json> builder(key, take);
  json::sax_parse(Characters(text), Characters(), &builder);
  return builder.document();
}

// Reads the file at once, as read_json_file does, and then gives away the elements.
json read_whole(const std::filesystem::path& file, const std::string& key,
                const std::function<void(json&&)>& take) {
  json document = read_json_file(file);
  const auto found = document.is_object() ? document.find(key) : document.end();
  if (found == document.end() || !found->is_array()) return document;
  for (json& element : *found) take(std::move(element));
  *found = json::array();
  return document;
}

std::optional<JsonText> opened(const std::filesystem::path& file) {
  try {
    return std::optional<JsonText>(std::in_place, file);
  } catch (const IoError& error) {
    if (!error.names_no_file()) throw;
    return std::nullopt;
  }
}

}  // namespace

json read_json_elements(const std::filesystem::path& file, const std::string& key,
                        const std::function<void(json&&)>& take) {
  std::optional<JsonText> text = opened(file);
  if (!text || text->bytes() > kMaxTextBytes || !text->is_plain()) return read_whole(file, key, take);
  text->skip_mark();
  // Reading the whole text again finds the line of the error and says what may be meant.
  try {
    return parsed(*text, key, take);
  } catch (const json::parse_error&) {
    read_json_file(file);
    throw;
  } catch (const TooDeep&) {
    read_json_file(file);
    throw;
  } catch (const RepeatedKey&) {
    read_json_file(file);
    throw;
  }
}

}  // namespace q3d::manifests
