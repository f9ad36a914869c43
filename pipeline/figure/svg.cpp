#include "pipeline/figure/svg.h"

#include <fmt/format.h>

#include <iterator>

namespace q3d::pipeline::figure {
namespace {

std::string_view name_of(Anchor anchor) {
  switch (anchor) {
    case Anchor::start:
      return "start";
    case Anchor::middle:
      return "middle";
    case Anchor::end:
      return "end";
  }
  return "start";
}

}  // namespace

std::string escaped(std::string_view text) {
  std::string result;
  for (const char c : text) {
    if (c == '&') {
      result += "&amp;";
    } else if (c == '<') {
      result += "&lt;";
    } else if (c == '>') {
      result += "&gt;";
    } else if (c == '"') {
      result += "&quot;";
    } else if (c == '\'') {
      result += "&#39;";
    } else {
      result += c;
    }
  }
  return result;
}

void Svg::text(Place at, Anchor anchor, std::string_view colour, std::string_view words) {
  fmt::format_to(std::back_inserter(elements_),
                 "<text x=\"{:.1f}\" y=\"{:.1f}\" text-anchor=\"{}\" fill=\"{}\">{}</text>\n", at.x, at.y,
                 name_of(anchor), colour, escaped(words));
}

void Svg::line(Place from, Place to, std::string_view style) {
  fmt::format_to(std::back_inserter(elements_),
                 "<line x1=\"{:.1f}\" y1=\"{:.1f}\" x2=\"{:.1f}\" y2=\"{:.1f}\" {}/>\n", from.x, from.y, to.x,
                 to.y, style);
}

void Svg::polyline(std::span<const Place> points, std::string_view colour) {
  elements_ += fmt::format("<polyline fill=\"none\" stroke=\"{}\" stroke-width=\"2\" points=\"", colour);
  for (const Place& point : points) elements_ += fmt::format("{:.1f},{:.1f} ", point.x, point.y);
  elements_ += "\"/>\n";
}

void Svg::dot(Place centre, double radius_px, std::string_view colour) {
  fmt::format_to(std::back_inserter(elements_),
                 "<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"{:g}\" fill=\"{}\"/>\n", centre.x, centre.y,
                 radius_px, colour);
}

std::string Svg::document(double width_px, double height_px) const {
  return fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0:.0f}\" height=\"{1:.0f}\" viewBox=\"0 0 {0:.0f} "
      "{1:.0f}\" font-family=\"sans-serif\" font-size=\"13\">\n<rect width=\"{0:.0f}\" height=\"{1:.0f}\" "
      "fill=\"#fff\"/>\n{2}</svg>\n",
      width_px, height_px, elements_);
}

}  // namespace q3d::pipeline::figure
