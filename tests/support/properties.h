// Property tests with rapidcheck: its GoogleTest bridge, a fixed seed, and generators that several folders
// use.
#pragma once

#include <rapidcheck/gtest.h>
#include <stdlib.h>

#include <string>
#include <vector>

namespace q3d::testing {

// rapidcheck draws another seed in every run unless RC_PARAMS names one. A test must not fail by chance, so
// the seed is fixed; RC_PARAMS="seed=1 max_success=10000" in the environment searches elsewhere and for
// longer.
inline const bool kSeedIsFixed = ::setenv("RC_PARAMS", "seed=20260501", /*overwrite=*/0) == 0;

// Generates a number on the grid with step 1/1024 between `low` and `high`, which are whole numbers.
inline rc::Gen<double> number_between(int low, int high) {
  return rc::gen::map(rc::gen::inRange(1024 * low, 1024 * high + 1), [](int n) { return n / 1024.0; });
}

// Generates UTF-8 text that is hard to write and read: separators, quotes, line ends, letters of two to four
// bytes.
inline rc::Gen<std::string> awkward_text() {
  const std::vector<std::string> pieces{"a",  "B",  "7",  " ",      "\t",     ",",      ";",   "\"",
                                        "'",  "\n", "\r", "\r\n",   "\"\"",   "żubr",   "犬",  "🐎",
                                        "\\", "/",  "#",  "\u00a0", "\u2028", "\ufeff", "=1+1"};
  return rc::gen::map(rc::gen::container<std::vector<std::string>>(rc::gen::elementOf(pieces)),
                      [](const std::vector<std::string>& chosen) {
                        std::string text;
                        for (const std::string& piece : chosen) text += piece;
                        return text;
                      });
}

}  // namespace q3d::testing
