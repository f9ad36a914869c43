#include "loaders/keypoints/keypoint_words.h"

#include <algorithm>
#include <array>
#include <cctype>
#include <optional>
#include <utility>
#include <vector>

namespace q3d::loaders::keypoints {
namespace {

using Words = std::vector<std::string>;

constexpr std::array<std::pair<std::string_view, Side>, 8> kSides{{{"left", Side::left},
                                                                   {"right", Side::right},
                                                                   {"near", Side::left},
                                                                   {"off", Side::right},
                                                                   {"lft", Side::left},
                                                                   {"rgt", Side::right},
                                                                   {"l", Side::left},
                                                                   {"r", Side::right}}};
constexpr std::array<std::pair<std::string_view, End>, 10> kEnds{{{"front", End::front},
                                                                  {"fore", End::front},
                                                                  {"thoracic", End::front},
                                                                  {"f", End::front},
                                                                  {"hind", End::back},
                                                                  {"rear", End::back},
                                                                  {"back", End::back},
                                                                  {"pelvic", End::back},
                                                                  {"h", End::back},
                                                                  {"b", End::back}}};

// The names of parts, without separators. The longest name that fits is taken.
constexpr auto kParts = std::to_array<std::pair<std::string_view, Part>>({
    {"eye", Part::eye},
    {"ear", Part::ear},
    {"earbase", Part::ear},
    {"earroot", Part::ear},
    {"eartip", Part::ear_tip},
    {"earend", Part::ear_tip},
    {"nose", Part::nose},
    {"nosetip", Part::nose},
    {"snout", Part::nose},
    {"muzzle", Part::nose},
    {"rostrum", Part::nose},
    {"nostril", Part::nose},
    {"chin", Part::chin},
    {"jaw", Part::chin},
    {"lowerjaw", Part::chin},
    {"upperjaw", Part::none},
    {"mandible", Part::chin},
    {"mouth", Part::mouth_corner},
    {"mouthcorner", Part::mouth_corner},
    {"mouthend", Part::mouth_corner},
    {"lip", Part::mouth_corner},
    {"lipcorner", Part::mouth_corner},
    {"neck", Part::neck},
    {"neckbase", Part::neck},
    {"neckend", Part::neck},
    {"nape", Part::neck},
    {"poll", Part::neck},
    {"withers", Part::withers},
    {"wither", Part::withers},
    {"shoulder", Part::shoulder},
    {"scapula", Part::shoulder},
    {"elbow", Part::elbow},
    {"carpus", Part::carpus},
    {"carpal", Part::carpus},
    {"wrist", Part::carpus},
    {"hip", Part::hip},
    {"stifle", Part::stifle},
    {"knee", Part::knee},
    {"hock", Part::tarsus},
    {"tarsus", Part::tarsus},
    {"tarsal", Part::tarsus},
    {"ankle", Part::tarsus},
    {"heel", Part::tarsus},
    {"thigh", Part::thigh},
    {"thai", Part::thigh},
    {"fetlock", Part::fetlock},
    {"pastern", Part::fetlock},
    {"paw", Part::paw},
    {"hoof", Part::paw},
    {"foot", Part::paw},
    {"feet", Part::paw},
    {"toe", Part::paw},
    {"toes", Part::paw},
    {"finger", Part::paw},
    {"hand", Part::paw},
    {"legpaw", Part::paw},
    {"legtop", Part::thigh},
    {"legmiddle", Part::knee},
    {"legbottom", Part::paw},
    {"tailbase", Part::tail_base},
    {"taildock", Part::tail_base},
    {"tailroot", Part::tail_base},
    {"tailstart", Part::tail_base},
    {"tailhead", Part::tail_base},
    {"tailset", Part::tail_base},
    {"roottail", Part::tail_base},
    {"basetail", Part::tail_base},
    {"rootoftail", Part::tail_base},
    {"baseoftail", Part::tail_base},
    {"tti", Part::tail_base},
    {"tail", Part::tail_base},
    {"tailmid", Part::tail_mid},
    {"tailmiddle", Part::tail_mid},
    {"midtail", Part::tail_mid},
    {"middletail", Part::tail_mid},
    {"tailtip", Part::tail_tip},
    {"tailend", Part::tail_tip},
    {"tiptail", Part::tail_tip},
    {"tipoftail", Part::tail_tip},
    {"endtail", Part::tail_tip},
    {"endoftail", Part::tail_tip},
});

// Splits "leftFrontPaw", "left_front_paw" and "L-F Paw" into lower-case words, and separates digits from
// letters.
Words parted(std::string_view name) {
  Words words;
  char before = '_';
  for (std::size_t i = 0; i < name.size(); ++i) {
    const char c = name[i];
    const auto u = static_cast<unsigned char>(c);
    const bool is_followed_by_lower =
        i + 1 < name.size() && std::islower(static_cast<unsigned char>(name[i + 1])) != 0;
    if (std::isalnum(u) == 0) {
      before = '_';
      continue;
    }
    const auto b = static_cast<unsigned char>(before);
    const bool begins = std::isalnum(b) == 0 || (std::isupper(u) != 0 && std::islower(b) != 0) ||
                        (std::isupper(u) != 0 && std::isupper(b) != 0 && is_followed_by_lower) ||
                        (std::isdigit(u) != 0) != (std::isdigit(b) != 0);
    if (begins) words.emplace_back();
    words.back() += static_cast<char>(std::tolower(u));
    before = c;
  }
  return words;
}

std::optional<Part> part_named(std::string_view word) {
  const auto found =
      std::find_if(kParts.begin(), kParts.end(), [&](const auto& each) { return each.first == word; });
  return found == kParts.end() ? std::nullopt : std::optional(found->second);
}

template <typename Table>
const typename Table::value_type* entry(const Table& table, std::string_view word) {
  const auto found =
      std::find_if(table.begin(), table.end(), [&](const auto& each) { return each.first == word; });
  return found == table.end() ? nullptr : &*found;
}

// Splits words for side and end off the beginning of a word: "nearfrontfoot", and both letters of "fl".
// Appends all words to `words`.
void split_glued(std::string word, Words& words) {
  constexpr std::size_t kLeast = 3;  // shorter words for side and end are not searched for within a word
  const bool is_pair =
      word.size() == 2 &&
      ((entry(kSides, word.substr(0, 1)) != nullptr && entry(kEnds, word.substr(1)) != nullptr) ||
       (entry(kEnds, word.substr(0, 1)) != nullptr && entry(kSides, word.substr(1)) != nullptr));
  if (is_pair) {
    words.push_back(word.substr(0, 1));
    words.push_back(word.substr(1));
    return;
  }
  const auto takes = [&](std::string_view prefix) {
    if (prefix.size() < kLeast || word.size() <= prefix.size() || !word.starts_with(prefix)) return false;
    words.emplace_back(prefix);
    word.erase(0, prefix.size());
    return true;
  };
  bool took = !part_named(word);
  while (took) {
    took = std::any_of(kSides.begin(), kSides.end(), [&](const auto& each) { return takes(each.first); }) ||
           std::any_of(kEnds.begin(), kEnds.end(), [&](const auto& each) { return takes(each.first); });
    took = took && !part_named(word);
  }
  words.push_back(std::move(word));
}

// Returns the part that all words except those for side and end name together, or else the part that the
// longest run of them names.
Part part_of(const Words& words) {
  for (std::size_t length = words.size(); length > 0; --length) {
    for (std::size_t first = 0; first + length <= words.size(); ++first) {
      std::string joined;
      for (std::size_t i = first; i < first + length; ++i) joined += words[i];
      if (const auto part = part_named(joined)) return *part;
    }
  }
  return Part::none;
}

}  // namespace

KeypointWords words_of(std::string_view name) {
  Words words;
  for (std::string& word : parted(name)) split_glued(std::move(word), words);
  KeypointWords read;
  Words rest;
  for (const std::string& word : words) {
    const auto* side = entry(kSides, word);
    const auto* end = entry(kEnds, word);
    if (side != nullptr && read.side == Side::none) {
      read.side = side->second;
      continue;
    }
    read.without_side += (read.without_side.empty() ? "" : "_") + word;
    if (end != nullptr && read.end == End::none) {
      read.end = end->second;
    } else {
      rest.push_back(word);
    }
  }
  read.part = part_of(rest);
  return read;
}

}  // namespace q3d::loaders::keypoints
