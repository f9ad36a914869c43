#include "manifests/sealed_json.h"

#include <fmt/format.h>

#include <optional>
#include <string_view>

#include "manifests/atomic_file.h"
#include "manifests/digest.h"
#include "manifests/json_parse.h"

namespace q3d::manifests {
namespace {

using nlohmann::ordered_json;

constexpr std::string_view kBeforeDigits = "  \"digest\": \"";
constexpr std::string_view kAfterDigits = "\"\n}\n";
constexpr std::size_t kDigits = 64;

// The parts of a sealed text: `body`, then the line of the digest and the closing brace.
struct Parts {
  std::string_view body;
  std::string_view digest;
};

// Returns nothing if the text does not end as a sealed document does.
std::optional<Parts> split(std::string_view text) {
  constexpr std::size_t kTail = kBeforeDigits.size() + kDigits + kAfterDigits.size();
  if (text.size() < kTail || !text.ends_with(kAfterDigits)) return std::nullopt;
  const std::string_view tail = text.substr(text.size() - kTail);
  if (!tail.starts_with(kBeforeDigits)) return std::nullopt;
  return Parts{text.substr(0, text.size() - kTail), tail.substr(kBeforeDigits.size(), kDigits)};
}

ordered_json parse_object(const std::filesystem::path& file, const std::string& text) {
  try {
    ordered_json document = parse_json<ordered_json>(text);
    if (document.is_object()) return document;
  } catch (const ordered_json::exception& error) {
    throw DamagedDocument(fmt::format("{}: not readable JSON: {}", file.string(), error.what()));
  } catch (const TooDeep& error) {
    throw DamagedDocument(fmt::format("{}: {}", file.string(), error.what()));
  } catch (const RepeatedKey& error) {
    throw DamagedDocument(fmt::format("{}: {}", file.string(), error.what()));
  }
  throw DamagedDocument(fmt::format("{}: got no JSON object, expected one", file.string()));
}

}  // namespace

std::string seal_json(const ordered_json& document) {
  if (!document.is_object() || document.empty() || document.contains(kDigestKey)) {
    throw std::invalid_argument("seal_json: expected an object with members and without a digest");
  }
  std::string text = document.dump(2);
  text.resize(text.size() - std::string_view("\n}").size());
  text += ",\n";
  const std::string digest = sha256(text);
  return text.append(kBeforeDigits).append(digest).append(kAfterDigits);
}

SealedDocument read_sealed_json(const std::filesystem::path& file) {
  const std::string text = read_file(file);
  const std::optional<Parts> parts = split(text);
  if (parts) {
    const std::string got = sha256(parts->body);
    if (got != parts->digest) {
      throw DamagedDocument(fmt::format("{}: its text has the SHA-256 {}, its member \"digest\" says {}",
                                        file.string(), got, parts->digest));
    }
  }
  SealedDocument sealed{parse_object(file, text), parts.has_value()};
  if (!parts && sealed.document.contains(kDigestKey)) {
    throw DamagedDocument(fmt::format(
        "{}: its member \"digest\" is not its last line but one, as it was written", file.string()));
  }
  sealed.document.erase(kDigestKey);
  return sealed;
}

}  // namespace q3d::manifests
