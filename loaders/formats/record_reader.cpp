#include "loaders/formats/record_reader.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <utility>

#include "manifests/json_file.h"
#include "manifests/valid_utf8.h"

namespace q3d::loaders::formats {
namespace {

using manifests::Reason;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

}  // namespace

RecordReader::RecordReader(const nlohmann::json& record, std::string where, manifests::SampleRecord& sample)
    : record_(record), where_(std::move(where)), sample_(sample) {
  if (!record.is_object()) fail(Reason::record_malformed, "", manifests::describe(record), "an object");
}

const nlohmann::json* RecordReader::find(const std::string& field) const {
  if (!record_.is_object()) return nullptr;
  const auto found = record_.find(field);
  return found == record_.end() || found->is_null() ? nullptr : &*found;
}

bool RecordReader::has(const std::string& field) const {
  return find(field) != nullptr;
}

void RecordReader::fail(Reason reason, std::string_view field, std::string_view got,
                        std::string_view expected) {
  if (failed()) return;
  sample_.failure = reason;
  sample_.failure_detail = manifests::valid_utf8(
      fmt::format("{}{}{}: got {}, expected {}", where_, field.empty() ? "" : ".", field, got, expected));
}

std::string RecordReader::text(const std::string& field) {
  if (!has(field)) fail(Reason::record_malformed, field, "nothing", "a text");
  return optional_text(field);
}

std::string RecordReader::optional_text(const std::string& field) {
  const nlohmann::json* value = find(field);
  if (value == nullptr) return {};
  if (value->is_string()) return value->get<std::string>();
  fail(Reason::record_malformed, field, manifests::describe(*value), "a text");
  return {};
}

std::optional<double> RecordReader::number(const std::string& field) {
  const nlohmann::json* value = find(field);
  if (value == nullptr) return std::nullopt;
  std::vector<double> one;
  const auto path = [&] { return field; };
  if (!append(*value, path, one)) return std::nullopt;
  return one.front();
}

std::optional<std::int64_t> RecordReader::integer(const std::string& field) {
  const nlohmann::json* value = find(field);
  if (value == nullptr) return std::nullopt;
  const double number = value->is_number() ? value->get<double>() : kNaN;
  if (number == std::floor(number) && std::abs(number) < 9e15) return static_cast<std::int64_t>(number);
  fail(Reason::record_malformed, field, manifests::describe(*value), "a whole number");
  return std::nullopt;
}

int RecordReader::size_px(const std::string& field) {
  const nlohmann::json* value = find(field);
  if (value == nullptr || manifests::is_beyond_json(*value)) return 0;
  double size = kNaN;
  if (value->is_number()) size = value->get<double>();
  if (value->is_string()) {
    const auto& text = value->get_ref<const std::string&>();
    if (text.empty()) return 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), size);
    if (error != std::errc() || end != text.data() + text.size()) size = kNaN;
  }
  if (size <= 0.0) return 0;
  if (size == std::floor(size) && size <= kMaxCoordinatePx) return static_cast<int>(size);
  fail(Reason::record_malformed, field, manifests::describe(*value), "a size in whole pixels");
  return 0;
}

bool RecordReader::append(const nlohmann::json& value, const std::function<std::string()>& path,
                          std::vector<double>& numbers) {
  if (value.is_number()) {
    numbers.push_back(value.get<double>());
  } else if (value.is_null() || manifests::is_beyond_json(value)) {
    numbers.push_back(kNaN);
  } else {
    fail(Reason::record_malformed, path(), manifests::describe(value), "a number");
    return false;
  }
  return true;
}

std::vector<double> RecordReader::numbers(const std::string& field, std::size_t rows, std::size_t columns,
                                          Reason missing, Reason wrong_length) {
  const std::string shape =
      columns == 1 ? fmt::format("{} numbers", rows) : fmt::format("{} x {} numbers", rows, columns);
  const nlohmann::json* value = find(field);
  if (value == nullptr) {
    fail(missing, field, "nothing", shape);
    return {};
  }
  if (!value->is_array()) {
    fail(Reason::record_malformed, field, manifests::describe(*value), shape);
    return {};
  }
  const bool nested = columns > 1 && !value->empty() && value->front().is_array();
  if (value->size() != (nested ? rows : rows * columns)) {
    fail(wrong_length, field, manifests::describe(*value), shape);
    return {};
  }
  std::vector<double> numbers;
  numbers.reserve(rows * columns);
  for (std::size_t i = 0; i < value->size(); ++i) {
    const nlohmann::json& item = (*value)[i];
    const auto path = [&] { return fmt::format("{}[{}]", field, i); };
    if (!nested) {
      if (!append(item, path, numbers)) return {};
      continue;
    }
    if (!item.is_array() || item.size() != columns) {
      fail(wrong_length, path(), manifests::describe(item), fmt::format("{} numbers", columns));
      return {};
    }
    for (std::size_t c = 0; c < columns; ++c) {
      const auto inner = [&] { return fmt::format("{}[{}]", path(), c); };
      if (!append(item[c], inner, numbers)) return {};
    }
  }
  return numbers;
}

std::vector<double> RecordReader::finite_numbers(const std::string& field, std::size_t rows,
                                                 std::size_t columns) {
  std::vector<double> values =
      numbers(field, rows, columns, Reason::record_malformed, Reason::record_malformed);
  constexpr double kMax = std::numeric_limits<float>::max();
  const auto bad =
      std::find_if(values.begin(), values.end(), [](double v) { return !(std::abs(v) <= kMax); });
  if (bad == values.end()) return values;
  fail(Reason::record_malformed, fmt::format("{}, number {}", field, bad - values.begin()),
       fmt::format("{}", *bad), "a finite float32");
  return {};
}

bool is_placeholder(double x_px, double y_px) {
  return x_px == y_px && (x_px == 0.0 || x_px == -1.0);
}

bool set_keypoint(double x_px, double y_px, double v, manifests::Keypoint& keypoint) {
  const bool is_position = std::abs(x_px) <= kMaxCoordinatePx && std::abs(y_px) <= kMaxCoordinatePx;
  keypoint = {};
  if (std::isnan(v) && !is_position) return true;  // the whole point is missing, as pandas writes it
  if (!std::isfinite(static_cast<float>(v)) || (v > 0.0 && !is_position)) return false;
  keypoint.v = static_cast<float>(v);
  keypoint.weight = v > 0.0 && !is_placeholder(x_px, y_px) ? 1.0F : 0.0F;
  if (is_position) {
    keypoint.x_px = x_px;
    keypoint.y_px = y_px;
  }
  return true;
}

std::vector<manifests::Keypoint> RecordReader::keypoints(const std::string& field, std::size_t count) {
  const std::vector<double> values =
      numbers(field, count, 3, Reason::keypoints_missing, Reason::keypoints_wrong_length);
  std::vector<manifests::Keypoint> points(count);
  for (std::size_t i = 0; i < count && !values.empty(); ++i) {
    const double* point = values.data() + 3 * i;
    if (!set_keypoint(point[0], point[1], point[2], points[i])) {
      fail(Reason::keypoints_not_finite, fmt::format("{}[{}]", field, i),
           fmt::format("({}, {}, {})", point[0], point[1], point[2]),
           fmt::format("a position within {} px", kMaxCoordinatePx));
    }
  }
  return points;
}

bool RecordReader::has_box(const std::string& field) const {
  const nlohmann::json* box = find(field);
  if (box == nullptr) return false;
  if (box->is_string()) return !box->get_ref<const std::string&>().empty();
  if (!box->is_array()) return true;
  const auto is_nothing = [](const nlohmann::json& value) { return value.is_null() || value == 0.0; };
  const auto is_minus_one = [](const nlohmann::json& value) { return value == -1.0; };
  if (std::all_of(box->begin(), box->end(), is_nothing)) return false;
  return box->size() != 4 || !((is_nothing((*box)[2]) && is_nothing((*box)[3])) ||
                               std::all_of(box->begin(), box->end(), is_minus_one));
}

manifests::Box RecordReader::box(const std::string& field) {
  const std::vector<double> values = numbers(field, 4, 1, Reason::box_missing, Reason::record_malformed);
  if (values.empty()) return {};
  for (const double value : values) {
    if (std::abs(value) <= kMaxCoordinatePx) continue;
    fail(Reason::box_not_finite, field,
         fmt::format("({}, {}, {}, {})", values[0], values[1], values[2], values[3]),
         fmt::format("four numbers within {} px", kMaxCoordinatePx));
    return {};
  }
  return {values[0], values[1], values[2], values[3]};
}

}  // namespace q3d::loaders::formats
