// Numbers that Python writes into JSON and that JSON cannot hold: NaN, Infinity, and those beyond double.
#pragma once

#include <cstddef>
#include <string>

namespace q3d::manifests {

// Turns such numbers into texts of tildes of the same length, so that the rest of the file stays readable and
// byte positions stay true. is_beyond_json() (json_file.h) knows these texts.
class JsonMask {
 public:
  // Goes over the text from `from` on, and returns how far it is done. If `is_end` is false, more text
  // follows, and what may be cut in the middle of a word is left for the next call, which must begin there.
  std::size_t apply(std::string& text, std::size_t from, bool is_end);

 private:
  bool in_string_ = false;
};

}  // namespace q3d::manifests
