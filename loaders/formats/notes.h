// Remarks about a dataset. Each is reported once, with the number of records it concerns and the first of
// them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace q3d::loaders::formats {

class Notes {
 public:
  void add(std::string text) { plain_.push_back(std::move(text)); }

  void count(const std::string& text, const std::string& sample_id) {
    const auto known = std::find_if(counted_.begin(), counted_.end(),
                                    [&](const Counted& each) { return each.text == text; });
    if (known == counted_.end()) {
      counted_.push_back({text, sample_id, 1});
    } else {
      ++known->records;
    }
  }

  // Returns the notes in the order of their first occurrence. Those that count records come last.
  std::vector<std::string> list() const {
    std::vector<std::string> all = plain_;
    for (const Counted& each : counted_) {
      all.push_back(each.text + ": " + std::to_string(each.records) +
                    (each.records == 1 ? " record" : " records") + ", first " + each.first);
    }
    return all;
  }

 private:
  struct Counted {
    std::string text;
    std::string first;
    std::size_t records = 0;
  };
  std::vector<std::string> plain_;
  std::vector<Counted> counted_;
};

}  // namespace q3d::loaders::formats
