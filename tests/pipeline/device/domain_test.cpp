#include "pipeline/device/domain.h"

#include <gmock/gmock.h>

#include <cmath>
#include <stdexcept>
#include <string>

namespace q3d::pipeline::device {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::ThrowsMessage;

NetworkDomain rendered() {
  return {
      Pictures::rendered, "the world", "its test pictures", 500, {{0.05, 0.01}, {0.5, 0.04}, {0.95, 0.125}}};
}

TEST(Domain, ComesBackFromItsText) {
  const NetworkDomain domain = domain_from_json(to_json(rendered()));
  EXPECT_EQ(domain.pictures, Pictures::rendered);
  EXPECT_EQ(domain.trained_on, "the world");
  EXPECT_EQ(domain.held_out, "its test pictures");
  EXPECT_EQ(domain.held_out_pictures, 500);
  ASSERT_EQ(domain.quantiles.size(), 3U);
  EXPECT_EQ(quantile(domain, 0.05), 0.01);
  EXPECT_EQ(quantile(domain, 0.95), 0.125);
  EXPECT_EQ(quantile(domain, 0.75), std::nullopt);
  const NetworkDomain unmeasured = domain_from_json(to_json({Pictures::photographs, "Animal3D", "", 0, {}}));
  EXPECT_EQ(unmeasured.pictures, Pictures::photographs);
  EXPECT_TRUE(unmeasured.quantiles.empty());
}

TEST(Domain, RefusesAnotherForm) {
  const auto expect_refused = [](const std::string& text, const std::string& why) {
    EXPECT_THAT([&] { domain_from_json(text); },
                ThrowsMessage<std::runtime_error>(AllOf(HasSubstr("prima_domain"), HasSubstr(why))));
  };
  expect_refused("[]", "expected the form");
  expect_refused(R"({"trained_on": "x"})", "pictures");
  expect_refused(R"({"pictures": "drawn", "trained_on": "x"})", "unknown kind of pictures \"drawn\"");
  const std::string begin =
      R"({"pictures": "rendered", "trained_on": "x", "held_out": {"what": "y", "pictures": 3,)";
  expect_refused(begin + R"("l_proj": {"0.5": 0.4, "0.95": 0.2}}})", "ascending errors");
  expect_refused(begin + R"("l_proj": {"1.5": 0.4}}})", "shares between 0 and 1");
}

// By hand, the quantile of 0, 1, 2, 3, 4 at share s is 4 s.
TEST(Quantiles, AreInterpolatedLinearly) {
  const auto quantiles = quantiles_of({3, 0, 4, 1, 2}, {0.05, 0.5, 0.95});
  EXPECT_DOUBLE_EQ(quantiles[0].l_proj, 0.2);
  EXPECT_DOUBLE_EQ(quantiles[1].l_proj, 2.0);
  EXPECT_DOUBLE_EQ(quantiles[2].l_proj, 3.8);
  EXPECT_EQ(quantiles_of({7}, {0.95}).front().l_proj, 7.0);
  EXPECT_THROW(quantiles_of({}, {0.5}), std::invalid_argument);
  EXPECT_THROW(quantiles_of({std::nan("")}, {0.5}), std::invalid_argument);
}

}  // namespace
}  // namespace q3d::pipeline::device
