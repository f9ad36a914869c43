// Collects the notes of one dataset. Each note is given once, with the number of records or files it concerns
// and the first of them.
#pragma once

#include <algorithm>
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

#include "loaders/formats/note.h"

namespace q3d::loaders::formats {

class Notes {
 public:
  void add(std::string text, NoteKind kind = NoteKind::remark) { plain_.push_back({kind, std::move(text)}); }

  void count(const std::string& text, const std::string& sample_id, NoteKind kind = NoteKind::remark) {
    count_one({kind, text, "record", sample_id});
  }
  void count_files(const std::string& text, const std::string& file, NoteKind kind = NoteKind::remark) {
    count_one({kind, text, "file", file});
  }

  // Returns the notes in the order of their first occurrence. Those that count come last.
  std::vector<Note> list() const {
    std::vector<Note> all = plain_;
    for (const Counted& each : counted_) {
      all.push_back({each.kind, each.text + ": " + std::to_string(each.times) + " " + each.what +
                                    (each.times == 1 ? "" : "s") + ", first " + each.first});
    }
    return all;
  }

 private:
  struct Counted {
    NoteKind kind;
    std::string text;
    const char* what;  // the thing that is counted: a record, a file
    std::string first;
    std::size_t times = 1;
  };

  void count_one(Counted counted) {
    const auto known = std::find_if(counted_.begin(), counted_.end(),
                                    [&](const Counted& each) { return each.text == counted.text; });
    if (known == counted_.end()) {
      counted_.push_back(std::move(counted));
    } else {
      ++known->times;
    }
  }

  std::vector<Note> plain_;
  std::vector<Counted> counted_;
};

}  // namespace q3d::loaders::formats
