#include "pipeline/figure/svg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

namespace q3d::pipeline::figure {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(Svg, ATextCannotBecomeAnElement) {
  EXPECT_EQ(escaped(R"(<b onload="x">'&'</b>)"), "&lt;b onload=&quot;x&quot;&gt;&#39;&amp;&#39;&lt;/b&gt;");
  Svg svg;
  svg.text({1, 2}, Anchor::middle, "#222", "<script>alert(1)</script>");
  EXPECT_THAT(svg.document(10, 20), Not(HasSubstr("<script>")));
}

TEST(Svg, ElementsStandWhereTheyAreAsked) {
  Svg svg;
  EXPECT_TRUE(svg.is_empty());
  svg.line({1, 2}, {3, 4.25}, "stroke=\"#ddd\"");
  svg.polyline(std::vector<Place>{{5, 6}, {7, 8}}, "#123456");
  Svg dots;
  dots.dot({9, 10}, 3.5, "#654321");
  svg.append(dots);
  EXPECT_FALSE(svg.is_empty());
  const std::string document = svg.document(100, 200);
  EXPECT_THAT(document, HasSubstr(R"(<line x1="1.0" y1="2.0" x2="3.0" y2="4.2" stroke="#ddd"/>)"));
  EXPECT_THAT(document, HasSubstr(R"(points="5.0,6.0 7.0,8.0 ")"));
  EXPECT_THAT(document, HasSubstr(R"(<circle cx="9.0" cy="10.0" r="3.5" fill="#654321"/>)"));
  EXPECT_THAT(document, HasSubstr(R"(viewBox="0 0 100 200")"));
}

}  // namespace
}  // namespace q3d::pipeline::figure
