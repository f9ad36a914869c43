// A remark about a dataset, for the person who builds it.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

namespace q3d::loaders::formats {

enum class NoteKind : std::uint8_t {
  remark,   // says how a file was read
  caution,  // labels were left out or may be wrong. `--quiet` does not hide it
};

inline std::string_view to_string(NoteKind kind) {
  return kind == NoteKind::caution ? "caution" : "remark";
}

struct Note {
  NoteKind kind = NoteKind::remark;
  std::string text;  // one line, without the dataset's name
};

}  // namespace q3d::loaders::formats
