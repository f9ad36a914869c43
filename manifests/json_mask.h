// Masks numbers that Python writes into JSON and that JSON cannot hold: NaN, Infinity, and numbers beyond
// double.
#pragma once

#include <cstddef>
#include <string>

namespace q3d::manifests {

// Turns such numbers into texts of tildes of the same length, so that the rest of the file stays readable and
// byte positions stay true. is_beyond_json() (json_file.h) knows these texts.
class JsonMask {
 public:
  // Masks the text from position `from` on and returns the position up to which it is done. If `is_end` is
  // false, more text follows; a word that may be incomplete is left for the next call, which must begin at
  // the returned position.
  std::size_t apply(std::string& text, std::size_t from, bool is_end);

 private:
  bool in_string_ = false;
};

}  // namespace q3d::manifests
