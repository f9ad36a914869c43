#include "manifests/table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <stdexcept>

namespace q3d::manifests {
namespace {

struct TypeFacts {
  std::string_view name;
  std::size_t size;
};
// The entries are in the order of ElementType.
constexpr std::array<TypeFacts, 6> kTypes{
    {{"float32", 4}, {"float64", 8}, {"int8", 1}, {"uint8", 1}, {"int32", 4}, {"int64", 8}}};
static_assert(kTypes.size() == static_cast<std::size_t>(ElementType::int64) + 1);

}  // namespace

std::size_t size_of(ElementType type) {
  return kTypes.at(static_cast<std::size_t>(type)).size;
}
std::string_view to_string(ElementType type) {
  return kTypes.at(static_cast<std::size_t>(type)).name;
}

std::int64_t elements_per_row(const std::vector<std::int64_t>& row_shape) {
  std::int64_t count = 1;
  for (const std::int64_t extent : row_shape) count *= extent;
  return count;
}

template <typename T>
std::span<const T> NumericColumn::as() const {
  if (type != element_type<T>::value) {
    throw std::logic_error(
        fmt::format("the column is {}, not {}", to_string(type), to_string(element_type<T>::value)));
  }
  return {reinterpret_cast<const T*>(data.data()), data.size() / sizeof(T)};
}

template <typename T>
void Table::add(const std::string& name, std::vector<std::int64_t> row_shape, std::span<const T> values) {
  const std::int64_t expected = rows * elements_per_row(row_shape);
  if (static_cast<std::int64_t>(values.size()) != expected) {
    throw std::logic_error(
        fmt::format("column {}: got {} numbers, expected {}", name, values.size(), expected));
  }
  const auto bytes = std::as_bytes(values);
  NumericColumn column{element_type<T>::value, std::move(row_shape), {bytes.begin(), bytes.end()}};
  if (!numeric.emplace(name, std::move(column)).second) {
    throw std::logic_error(fmt::format("column {} is there already", name));
  }
}

template <typename T>
std::span<const T> Table::column(const std::string& name) const {
  const auto found = numeric.find(name);
  if (found == numeric.end())
    throw std::runtime_error(fmt::format("the table has no numeric column {}", name));
  if (found->second.type != element_type<T>::value) {
    throw std::runtime_error(fmt::format("column {}: got {}, expected {}", name,
                                         to_string(found->second.type), to_string(element_type<T>::value)));
  }
  return found->second.as<T>();
}

template <typename T>
std::span<const T> Table::column(const std::string& name, std::size_t per_row) const {
  const std::span<const T> numbers = column<T>(name);
  if (numbers.size() == static_cast<std::size_t>(rows) * per_row) return numbers;
  throw std::runtime_error(
      fmt::format("column {} holds {} numbers, expected {} rows of {}", name, numbers.size(), rows, per_row));
}

const std::vector<std::string>& Table::texts(const std::string& name) const {
  const auto found = text.find(name);
  if (found == text.end()) throw std::runtime_error(fmt::format("text column {} is missing", name));
  return found->second;
}

#define Q3D_INSTANTIATE(T)                                                                        \
  template std::span<const T> NumericColumn::as<T>() const;                                       \
  template void Table::add<T>(const std::string&, std::vector<std::int64_t>, std::span<const T>); \
  template std::span<const T> Table::column<T>(const std::string&) const;                         \
  template std::span<const T> Table::column<T>(const std::string&, std::size_t) const;
Q3D_INSTANTIATE(float)
Q3D_INSTANTIATE(double)
Q3D_INSTANTIATE(std::int8_t)
Q3D_INSTANTIATE(std::uint8_t)
Q3D_INSTANTIATE(std::int32_t)
Q3D_INSTANTIATE(std::int64_t)
#undef Q3D_INSTANTIATE

}  // namespace q3d::manifests
