// A unit's results come back from its table as they were, and another table is refused.
#include "pipeline/evaluation/result_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <stdexcept>
#include <vector>

namespace q3d::pipeline::evaluation {
namespace {

using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

constexpr std::size_t kSettings = 2;

// A measured sample, one without a mesh and truth, and one that failed.
std::vector<SampleResult> three() {
  std::vector<SampleResult> results(3);
  for (std::size_t i = 0; i < 2; ++i) {
    results[i].id = i == 0 ? "zoo/test/a.png#0" : "zoo/test/b.png#1";
    results[i].normalised_by_mask = i == 0;
    results[i].values.resize(kSettings);
    results[i].betas.resize(kSettings);
    for (std::size_t s = 0; s < kSettings; ++s) {
      const double base = 1.0 + static_cast<double>(10 * i + s) / 3.0;
      results[i].values[s] = {base, 0.0, base * 2.0, std::nullopt, std::nullopt, base * 5.0};
      results[i].betas[s].fill(static_cast<float>(base));
    }
  }
  results[1].detail = "the mask is left out: it is not of the picture's size";
  results[2].id = "zoo/test/c.png#2";
  results[2].failure = manifests::Reason::image_missing;
  results[2].detail = "c?.png cannot be read";
  results[2].detail[1] = '\0';  // as a hostile annotation file names it
  return results;
}

// The same samples before anything was measured.
std::vector<SampleResult> blank() {
  std::vector<SampleResult> results(3);
  for (std::size_t i = 0; i < 3; ++i) results[i].id = three()[i].id;
  return results;
}

TEST(ResultTable, ComesBackAsItWas) {
  std::vector<SampleResult> results = blank();
  set_measured(to_table(three(), kSettings), kSettings, results);
  for (std::size_t i = 0; i < 3; ++i) {
    const SampleResult expected = three()[i];
    EXPECT_EQ(results[i].failure, expected.failure);
    EXPECT_EQ(results[i].detail, expected.detail);
    EXPECT_EQ(results[i].normalised_by_mask, expected.normalised_by_mask);
    EXPECT_EQ(results[i].values, expected.values);
    EXPECT_EQ(results[i].betas, expected.betas);
  }
}

TEST(ResultTable, AnotherTableIsRefused) {
  const manifests::Table table = to_table(three(), kSettings);
  std::vector<SampleResult> results = blank();
  std::swap(results[0], results[1]);
  EXPECT_THAT([&] { set_measured(table, kSettings, results); },
              ThrowsMessage<std::runtime_error>(HasSubstr("other samples")));
  results = blank();
  EXPECT_THAT([&] { set_measured(table, kSettings + 1, results); },
              ThrowsMessage<std::runtime_error>(HasSubstr("is_measured")));
  manifests::Table without = table;
  without.text.erase("failure");
  EXPECT_THAT([&] { set_measured(without, kSettings, results); },
              ThrowsMessage<std::runtime_error>(HasSubstr("column failure is missing")));
}

}  // namespace
}  // namespace q3d::pipeline::evaluation
