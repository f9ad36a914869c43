// These tests check what is said about the quality of labels for given errors and origins.
#include "pipeline/build/quality.h"

#include <gmock/gmock.h>

#include <stdexcept>

namespace q3d::pipeline::build {
namespace {

using dataset::Warning;
using dataset::WarningKind;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

// A network of rendered pictures whose own held-out pictures lie below 0.1 in 95 of 100 cases.
Origins rendered_origins() {
  Origins origins;
  origins.domain = {device::Pictures::rendered, "the world", "its tests", 500, {{0.5, 0.05}, {0.95, 0.1}}};
  origins.has_rendered_body = true;
  return origins;
}

PoolErrors pool(bool is_rendered, std::vector<double> errors) {
  return {"animals", is_rendered, std::move(errors), 0.08};
}

std::vector<WarningKind> kinds(const std::vector<Warning>& warnings) {
  std::vector<WarningKind> list;
  for (const Warning& each : warnings) list.push_back(each.kind);
  return list;
}

TEST(QualityWarnings, ARenderedPoolOfItsOwnNetworkHasNone) {
  EXPECT_TRUE(quality_warnings({pool(true, {0.02, 0.05, 0.3})}, rendered_origins(), 0.1).empty());
}

TEST(QualityWarnings, PhotographsUnderARenderedNetworkAndBodyAreTold) {
  const auto warnings = quality_warnings({pool(false, {0.02})}, rendered_origins(), 0.1);
  EXPECT_EQ(kinds(warnings), (std::vector{WarningKind::rendered_network, WarningKind::rendered_body}));
  EXPECT_EQ(warnings[0].dataset, "animals");
  EXPECT_THAT(warnings[0].message, AllOf(HasSubstr("photographs"), HasSubstr("the world")));
  Origins official;
  official.domain.pictures = device::Pictures::photographs;
  EXPECT_TRUE(quality_warnings({pool(false, {0.02})}, official, 0.1).empty());
}

TEST(QualityWarnings, AMedianBeyondTheNetworksOwnPicturesIsTold) {
  EXPECT_TRUE(quality_warnings({pool(true, {0.05, 0.1, 0.9})}, rendered_origins(), 0.1).empty())
      << "the bound itself is not beyond";
  const auto warnings = quality_warnings({pool(true, {0.05, 0.11, 0.9})}, rendered_origins(), 0.1);
  ASSERT_EQ(kinds(warnings), std::vector{WarningKind::outside_domain});
  EXPECT_THAT(warnings[0].message, AllOf(HasSubstr("0.1100"), HasSubstr("0.1000"), HasSubstr("its tests")));
  Origins unmeasured;
  EXPECT_TRUE(quality_warnings({pool(true, {0.9})}, unmeasured, 0.1).empty());
}

TEST(QualityWarnings, ACeilingThatWasPassedStaysAWarning) {
  EXPECT_EQ(kinds(quality_warnings({pool(true, {0.05})}, rendered_origins(), 0.07)),
            std::vector{WarningKind::above_ceiling});
}

TEST(Ceiling, IsItselfAllowed) {
  EXPECT_NO_THROW(require_below_ceiling("animals", 0.1, 0.1));
  EXPECT_THAT(
      [] { require_below_ceiling("animals", 0.27, 0.1); },
      ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("dataset animals is 0.27"),
                                              HasSubstr("tau_ceiling = 0.1"), HasSubstr("--above-ceiling"))));
}

TEST(Labels, ADatasetWithoutAnyIsRefusedWithItsReasons) {
  dataset::DatasetManifest manifest;
  manifest.counts = {.candidates = 9, .retained = 0, .refined = 1, .discarded = 5, .failed = 3};
  EXPECT_NO_THROW(require_labels(manifest, "out/v", 0.9));
  manifest.counts.refined = 0;
  manifest.reasons = {{manifests::Reason::error_too_large, 5}, {manifests::Reason::image_missing, 3}};
  EXPECT_THAT([&] { require_labels(manifest, "out/v", 0.9); },
              ThrowsMessage<std::runtime_error>(
                  AllOf(HasSubstr("no label was kept: of 9 candidates 5 were discarded and 3 failed"),
                        HasSubstr("error_too_large 5"), HasSubstr("out/v/verdicts.csv"))));
  manifest.counts = {.candidates = 3, .retained = 0, .refined = 0, .discarded = 0, .failed = 3};
  EXPECT_THAT([&] { require_labels(manifest, "out/v", 0.9); },
              ThrowsMessage<std::runtime_error>(HasSubstr("all 3 candidates failed")));
  manifest.counts = {};
  EXPECT_THAT([&] { require_labels(manifest, "out/v", 0.9); },
              ThrowsMessage<std::runtime_error>(HasSubstr("there are no candidates")));
}

// Pictures on a disk that is not mounted: what is left must not take the place of a good dataset.
TEST(Labels, ADatasetOfWhichTooManyFailedIsRefused) {
  dataset::DatasetManifest manifest;
  manifest.counts = {.candidates = 10, .retained = 1, .refined = 0, .discarded = 0, .failed = 9};
  manifest.reasons = {{manifests::Reason::image_missing, 9}};
  EXPECT_NO_THROW(require_labels(manifest, "out/v", 0.9));
  EXPECT_NO_THROW(require_labels(manifest, "out/v", 1.0));
  EXPECT_THAT(
      [&] { require_labels(manifest, "out/v", 0.85); },
      ThrowsMessage<std::runtime_error>(AllOf(
          HasSubstr("9 of 10 candidates failed, which is more than the share of max_failed_share = 0.85"),
          HasSubstr("image_missing 9"), HasSubstr("`latest` stays"))));
}

}  // namespace
}  // namespace q3d::pipeline::build
