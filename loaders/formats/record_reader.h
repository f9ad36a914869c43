// Reading the records of an annotation file, each of which may be bad without harm to the others.
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

// Reads the fields of one record. The first thing found wrong becomes the sample's failure, with file, index,
// field, got and expected; reading then goes on and returns something harmless, so that parsers need no
// exits.
class RecordReader {
 public:
  // `where` names file and index, e.g. "train.json: data[12]". All three outlive the reader.
  RecordReader(const nlohmann::json& record, std::string where, manifests::SampleRecord& sample);

  bool has(const std::string& field) const;  // there, and not null
  bool failed() const { return sample_.failure != manifests::Reason::none; }
  void fail(manifests::Reason reason, std::string_view field, std::string_view got,
            std::string_view expected);

  std::string text(const std::string& field);              // required
  std::string optional_text(const std::string& field);     // "" when it is not there
  std::optional<double> number(const std::string& field);  // nothing when it is not there; NaN if not finite
  std::optional<std::int64_t> integer(const std::string& field);  // nothing when it is not there
  // Pixels of the image's size; 0 when it is not there.
  int size_px(const std::string& field);

  // `rows` x `columns` numbers, nested or flat; what is null or not finite is NaN. Empty when the field is
  // not there or of another shape, which fails with `missing` or `wrong_length`.
  std::vector<double> numbers(const std::string& field, std::size_t rows, std::size_t columns,
                              manifests::Reason missing, manifests::Reason wrong_length);
  // The same for a field that must be there in full, each number finite in float32.
  std::vector<double> finite_numbers(const std::string& field, std::size_t rows, std::size_t columns);

  // x, y, v of `count` keypoints. Weight is 1 where v > 0, else 0; unlabelled points may have any
  // coordinates.
  std::vector<manifests::Keypoint> keypoints(const std::string& field, std::size_t count);
  // Four numbers as they stand, the last two as width and height.
  manifests::Box box(const std::string& field);

 private:
  const nlohmann::json* find(const std::string& field) const;
  // `path` names the value; it is asked only when the value is no number.
  bool append(const nlohmann::json& value, const std::function<std::string()>& path,
              std::vector<double>& numbers);

  const nlohmann::json& record_;
  std::string where_;
  manifests::SampleRecord& sample_;
};

// A labelled keypoint must lie within this many pixels of the origin; what is farther is not a coordinate.
inline constexpr double kMaxCoordinatePx = 1e6;

// x, y, v -> keypoint. False when it is labelled (v > 0) and not at a coordinate.
bool set_keypoint(double x_px, double y_px, double v, manifests::Keypoint& keypoint);

}  // namespace q3d::loaders::formats
