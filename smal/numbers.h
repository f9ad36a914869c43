// Gives access to the numbers of this folder's value types, in the order in which files and tensors hold
// them.
#pragma once

#include <array>
#include <bit>
#include <cstddef>

namespace q3d::smal {

// `Value` is an array or a structure of float32 without gaps.
template <typename Value>
using NumbersOf = std::array<float, sizeof(Value) / sizeof(float)>;

// Returns the numbers of a value.
template <typename Value>
constexpr NumbersOf<Value> numbers_of(const Value& value) {
  return std::bit_cast<NumbersOf<Value>>(value);
}

// Returns the value that holds these numbers.
template <typename Value>
constexpr Value from_numbers(const NumbersOf<Value>& numbers) {
  return std::bit_cast<Value>(numbers);
}

}  // namespace q3d::smal
