// Writes the elements of SVG figures, and escapes text for SVG and HTML.
#pragma once

#include <span>
#include <string>
#include <string_view>

namespace q3d::pipeline::figure {

// Returns the text with &, <, > and quotation marks escaped, so that a browser shows them and does not
// interpret them.
std::string escaped(std::string_view text);

struct Place {
  double x;  // px from the left
  double y;  // px from the top
};

enum class Anchor { start, middle, end };

// Collects elements. Texts are escaped; colours and styles are the program's own words.
class Svg {
 public:
  void text(Place at, Anchor anchor, std::string_view colour, std::string_view words);
  void line(Place from, Place to, std::string_view style);  // style: attributes, such as stroke="#ddd"
  void polyline(std::span<const Place> points, std::string_view colour);
  void dot(Place centre, double radius_px, std::string_view colour);
  void append(const Svg& other) { elements_ += other.elements_; }
  bool is_empty() const { return elements_.empty(); }

  // Returns the whole document on a white background.
  std::string document(double width_px, double height_px) const;

 private:
  std::string elements_;
};

}  // namespace q3d::pipeline::figure
