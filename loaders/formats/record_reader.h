// Reads the records of an annotation file. A bad record does not affect the others.
#pragma once

#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "manifests/sample.h"

namespace q3d::loaders::formats {

// Reads the fields of one record. The first problem becomes the sample's failure, with file, index and field,
// what was found and what was expected. Reading then continues and returns harmless values, so that parsers
// need no early exits.
class RecordReader {
 public:
  // `where` names file and index, for example "train.json: data[12]". The record and the sample must outlive
  // the reader.
  RecordReader(const nlohmann::json& record, std::string where, manifests::SampleRecord& sample);

  bool has(const std::string& field) const;  // true if the field exists and is not null
  bool failed() const { return sample_.failure != manifests::Reason::none; }
  // Paths in a detail need not be UTF-8; bytes that are none are written out (manifests/valid_utf8.h).
  void fail(manifests::Reason reason, std::string_view field, std::string_view got,
            std::string_view expected);

  std::string text(const std::string& field);              // required
  std::string optional_text(const std::string& field);     // "" if it is absent
  std::optional<double> number(const std::string& field);  // nothing if it is absent; NaN if it is not finite
  std::optional<std::int64_t> integer(const std::string& field);  // nothing if it is absent
  // Returns the image's width or height in pixels, which the file may write as a number or as text. Returns 0
  // if it is absent, 0 or negative; tools write such values for an unknown size.
  int size_px(const std::string& field);

  // Returns `rows` x `columns` numbers, which may be nested or flat. A number that is null or not finite is
  // NaN. If the field is absent or has another shape, the result is empty and the record fails with `missing`
  // or `wrong_length`.
  std::vector<double> numbers(const std::string& field, std::size_t rows, std::size_t columns,
                              manifests::Reason missing, manifests::Reason wrong_length);
  // Returns such numbers of a field that must be complete and finite in float32.
  std::vector<double> finite_numbers(const std::string& field, std::size_t rows, std::size_t columns);

  // Returns x, y, v of `count` keypoints. The weight is 1 if v > 0 and the point is no placeholder, else 0.
  // Unlabelled points may have any coordinates.
  std::vector<manifests::Keypoint> keypoints(const std::string& field, std::size_t count);
  // Returns whether a box is stated. Tools write zeros, -1, null, "" or an empty list where nobody drew one.
  bool has_box(const std::string& field) const;
  // Returns the four numbers unchanged, the last two as width and height.
  manifests::Box box(const std::string& field);

 private:
  const nlohmann::json* find(const std::string& field) const;
  // Appends a value to the numbers. `path` returns the value's name for the message; it is called only if the
  // value is not a number.
  bool append(const nlohmann::json& value, const std::function<std::string()>& path,
              std::vector<double>& numbers);

  const nlohmann::json& record_;
  std::string where_;
  manifests::SampleRecord& sample_;
};

// A labelled keypoint must lie within this many pixels of the origin. A larger number is not a coordinate.
inline constexpr double kMaxCoordinatePx = 1e6;

// Returns whether tools put points that nobody set at this position: (0, 0) or (-1, -1).
bool is_placeholder(double x_px, double y_px);

// Makes a keypoint of x, y, v. A placeholder has weight 0, whatever its v. Returns false if the keypoint is
// labelled (v > 0) but x, y is not a coordinate.
bool set_keypoint(double x_px, double y_px, double v, manifests::Keypoint& keypoint);

}  // namespace q3d::loaders::formats
