#include "loaders/species/species.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <vector>

#include "loaders/species/species_table.h"

namespace q3d::loaders::species {
namespace {

using manifests::Family;

bool is_digits(std::string_view text, std::size_t count) {
  return text.size() >= count && std::all_of(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(count),
                                             [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool is_number(std::string_view text) {
  return !text.empty() && is_digits(text, text.size());
}

// Returns whether `word` is `name` or its last words.
bool ends_with_word(std::string_view name, std::string_view word) {
  return name == word ||
         (name.size() > word.size() && name.ends_with(word) && name[name.size() - word.size() - 1] == ' ');
}

std::vector<std::string> split_names(std::string_view subclass) {  // "Dog / Wolf" -> dog, wolf
  std::vector<std::string> names;
  while (!subclass.empty()) {
    const auto slash = subclass.find('/');
    std::string name = normalised_species(subclass.substr(0, slash));
    if (!name.empty()) names.push_back(std::move(name));
    subclass = slash == std::string_view::npos ? std::string_view() : subclass.substr(slash + 1);
  }
  return names;
}

// Returns the number of a synset: `n02412080_12159` -> 2412080.
std::optional<int> synset(std::string_view stem) {
  if (stem.empty() || stem[0] != 'n' || !is_digits(stem.substr(1), 8)) return std::nullopt;
  int number = 0;
  std::from_chars(stem.data() + 1, stem.data() + 9, number);
  return number;
}

std::string species_of_source(std::string_view source_dataset) {
  const std::string key = normalised_source(source_dataset);
  for (const auto& [name, species] : table::kSourcesOfOneSpecies) {
    if (key == name) return std::string(species);
  }
  return {};
}

}  // namespace

std::string normalised_species(std::string_view name) {
  std::string result;
  for (const unsigned char c : name) {
    if (c == '+' || c == '_' || std::isspace(c) != 0) {
      if (!result.empty() && result.back() != ' ') result += ' ';
    } else {
      result += static_cast<char>(std::tolower(c));
    }
  }
  while (!result.empty() && result.back() == ' ') result.pop_back();
  return result;
}

std::string normalised_source(std::string_view name) {
  std::string result;
  for (const unsigned char c : name) {
    if (std::isalnum(c) != 0) result += static_cast<char>(std::tolower(c));
  }
  return result;
}

std::string species_of_picture(std::string_view file_name, std::string_view source_dataset) {
  std::string_view stem = file_name.substr(file_name.find_last_of("/\\") + 1);
  stem = stem.substr(0, stem.rfind('.'));
  if (const auto number = synset(stem)) {
    if (*number >= table::kFirstDogSynset && *number <= table::kLastDogSynset) return "dog";
    for (const auto& [listed, species] : table::kSynsets) {
      if (listed == *number) return std::string(species);
    }
  }
  const auto bar = stem.find('_');
  const std::string_view head = stem.substr(0, bar);
  const std::string_view rest = bar == std::string_view::npos ? std::string_view() : stem.substr(bar + 1);
  if (head.size() == 12 && is_number(head) && !rest.empty() && !is_number(rest)) {
    return normalised_species(rest);
  }
  const std::string species = normalised_species(head);
  if (is_number(rest.substr(0, rest.find('_'))) && family_of_species(species)) return species;
  std::string from_source = species_of_source(source_dataset);
  if (!from_source.empty()) return from_source;
  for (const auto& [prefix, animal] : table::kAnimalPosePrefixes) {
    if (head.starts_with(prefix) && is_number(head.substr(prefix.size()))) return std::string(animal);
  }
  return {};
}

std::optional<Family> family_of_species(std::string_view species) {
  for (std::string_view name = species; !name.empty();) {
    for (const auto& [family, names] : table::kFamilies) {
      if (std::find(names.begin(), names.end(), name) != names.end()) return family;
    }
    // Then try the name without its first word: "polar bear" is in the table as "bear".
    const auto space = name.find(' ');
    name = space == std::string_view::npos ? std::string_view() : name.substr(space + 1);
  }
  return std::nullopt;
}

std::string not_a_quadruped(const AnimalClass& animal) {
  for (const std::string& name : {animal.parent_class, animal.animal_class}) {
    if (!name.empty() && normalised_species(name) != "mammal") {
      return fmt::format("class \"{}\", not a mammal", name);
    }
  }
  std::vector<std::string> names = split_names(animal.subclass);
  names.push_back(normalised_species(animal.animal));
  for (const std::string_view word : table::kNotQuadrupeds) {
    for (const std::string& name : names) {
      if (ends_with_word(name, word)) {
        return fmt::format("\"{}\" of subclass \"{}\", left out as a {}", animal.animal, animal.subclass,
                           word);
      }
    }
  }
  return {};
}

std::optional<Family> family_of(const AnimalClass& animal) {
  if (const auto family = family_of_species(normalised_species(animal.animal))) return family;
  std::optional<Family> common;
  for (const std::string& name : split_names(animal.subclass)) {
    const auto family = family_of_species(name);
    if (!family || (common && *common != *family)) return std::nullopt;
    common = family;
  }
  return common;
}

}  // namespace q3d::loaders::species
