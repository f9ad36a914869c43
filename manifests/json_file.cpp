#include "manifests/json_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <stdexcept>
#include <string_view>

#include "manifests/json_mask.h"
#include "manifests/json_parse.h"
#include "manifests/text_file.h"

namespace q3d::manifests {
namespace {

// Returns whether a line is "key:" or "key: value". YAML files begin with such a line.
bool is_yaml(std::string_view line) {
  const std::size_t colon = line.find(':');
  const bool ends_key =
      colon != std::string_view::npos && (colon + 1 == line.size() || line[colon + 1] == ' ');
  return ends_key && colon > 0 &&
         line.substr(0, colon).find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ_-") ==
             std::string_view::npos;
}

// Says what a text that the JSON parser refused really is, if it is recognised; else returns "".
std::string hint(std::string_view text, std::string_view reason) {
  if (reason.find("UTF-8") != std::string_view::npos) return " (save the file with the encoding UTF-8)";
  const std::string_view line = text.substr(0, text.find_first_of("\r\n"));
  if (line.starts_with("scorer,") || line.starts_with("scorer;") || line.starts_with("scorer\t")) {
    return " (this is a table as DeepLabCut and Lightning Pose write it: use \"format\": \"deeplabcut\")";
  }
  if (line.find("frame_idx,") != std::string_view::npos) {
    return " (this is SLEAP's analysis as CSV: use \"format\": \"sleap\")";
  }
  if (is_yaml(line)) {
    return " (this looks like YAML, such as DeepLabCut's config.yaml or YOLO's data.yaml, which holds no "
           "labels: name the file of labels)";
  }
  const bool is_numbers = line.find_first_not_of("0123456789.-+eE \t") == std::string_view::npos;
  if (is_numbers && std::count(line.begin(), line.end(), ' ') >= 4) {
    return " (these are lines of numbers, as YOLO writes them: export the labels as COCO Keypoints instead)";
  }
  if (reason.find("expected end of input") != std::string_view::npos) {
    return " (more text follows the first JSON value; if there is one on each line, as in JSON Lines, put "
           "them into one file of the expected form)";
  }
  return {};
}

}  // namespace

nlohmann::json read_json_file(const std::filesystem::path& file) {
  std::string text = read_text_file(file, "an annotation file in JSON");
  JsonMask().apply(text, 0, true);
  try {
    return parse_json<nlohmann::json>(text);
  } catch (const TooDeep& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  } catch (const RepeatedKey& error) {
    throw std::runtime_error(fmt::format("{}: {}", file.string(), error.what()));
  } catch (const nlohmann::json::parse_error& error) {
    const std::size_t at = std::min(error.byte, text.size());
    const auto line = 1 + std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(at), '\n');
    // The library's message begins with the position, which ends with ": ".
    std::string reason = error.what();
    const auto colon = reason.find(": ");
    if (colon != std::string::npos) reason.erase(0, colon + 2);
    // It also repeats what was read last, which may be the rest of the file.
    constexpr std::size_t kLongest = 300;
    if (reason.size() > kLongest) reason.replace(kLongest / 2, reason.size() - kLongest, " ... ");
    throw std::runtime_error(fmt::format(
        "{}: line {}, byte {} of {}: {}{}{}", file.string(), line, error.byte, text.size(), reason,
        at >= text.size() ? " (the file seems to be cut short)" : "", hint(text, reason)));
  }
}

const nlohmann::json& array_of(const nlohmann::json& document, const std::string& key,
                               const std::filesystem::path& file) {
  if (!document.is_object()) {
    throw std::runtime_error(fmt::format("{}: top level: got {}, expected an object with an array \"{}\"",
                                         file.string(), describe(document), key));
  }
  const auto found = document.find(key);
  if (found == document.end()) {
    std::string keys;
    for (const auto& item : document.items()) {
      keys += (keys.empty() ? "\"" : ", \"") + item.key() + "\"";
      if (keys.size() > 200) break;
    }
    throw std::runtime_error(fmt::format("{}: top level: got the keys {}, expected an array \"{}\"",
                                         file.string(), keys.empty() ? "(none)" : keys, key));
  }
  if (!found->is_array()) {
    throw std::runtime_error(
        fmt::format("{}: {}: got {}, expected an array", file.string(), key, describe(*found)));
  }
  return *found;
}

bool is_beyond_json(const nlohmann::json& value) {
  if (!value.is_string()) return false;
  const auto& text = value.get_ref<const std::string&>();
  return !text.empty() && text.find_first_not_of('~') == std::string::npos;
}

std::string describe(const nlohmann::json& value) {
  constexpr std::size_t kShown = 60;
  if (is_beyond_json(value)) return "a number that is not finite";
  if (value.is_string()) {
    const auto& text = value.get_ref<const std::string&>();
    std::size_t shown = std::min(text.size(), kShown);
    // Never cut a UTF-8 character, because this description is stored as JSON.
    while (shown > 0 && shown < text.size() && (static_cast<unsigned char>(text[shown]) & 0xC0U) == 0x80U)
      --shown;
    return fmt::format("the text \"{}{}\"", text.substr(0, shown), shown < text.size() ? "..." : "");
  }
  if (value.is_array()) return fmt::format("{} value{}", value.size(), value.size() == 1 ? "" : "s");
  if (value.is_object()) return fmt::format("an object of {} keys", value.size());
  return value.dump();
}

}  // namespace q3d::manifests
