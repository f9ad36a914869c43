#include "pipeline/report/lettering.h"

#include <opencv2/imgproc.hpp>

namespace q3d::pipeline::report {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;

double scale_of(TextSize size) {
  return size == TextSize::small ? 0.38 : 0.45;
}

// Replaces each character beyond ASCII by a single '?'. OpenCV's fonts would draw one for each byte.
std::string printable(const std::string& text) {
  std::string shown;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte & 0xC0U) == 0x80U) continue;  // a later byte of a UTF-8 character
    shown += byte >= 0x20 && byte < 0x7F ? c : '?';
  }
  return shown;
}

// Returns how many bytes of `word` fit into the width, but at least one character.
std::size_t fitting(const std::string& word, int width_px, TextSize size) {
  std::size_t count = 1;
  while (count < word.size() && text_width_px(word.substr(0, count + 1), size) <= width_px) ++count;
  return count;
}

}  // namespace

int line_height_px(TextSize size) {
  return size == TextSize::small ? 15 : 18;
}

int text_width_px(const std::string& text, TextSize size) {
  int baseline = 0;
  return cv::getTextSize(printable(text), kFont, scale_of(size), 1, &baseline).width;
}

std::vector<std::string> wrapped(const std::string& text, int width_px, TextSize size) {
  std::vector<std::string> lines;
  std::string line;
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t space = std::min(text.find(' ', at), text.size());
    std::string word = text.substr(at, space - at);
    at = std::min(space + 1, text.size());
    const std::string longer = line.empty() ? word : line + " " + word;
    if (text_width_px(longer, size) <= width_px) {
      line = longer;
      continue;
    }
    if (!line.empty()) lines.push_back(line);
    while (text_width_px(word, size) > width_px) {
      const std::size_t count = fitting(word, width_px, size);
      lines.push_back(word.substr(0, count));
      word.erase(0, count);
    }
    line = word;
  }
  if (!line.empty()) lines.push_back(line);
  return lines;
}

void write(cv::Mat& picture, const std::string& text, cv::Point at, TextSize size, const cv::Scalar& colour) {
  cv::putText(picture, printable(text), {at.x, at.y + line_height_px(size) - 5}, kFont, scale_of(size),
              colour, 1, cv::LINE_AA);
}

void write_on_photo(cv::Mat& picture, const std::string& text, cv::Point at, TextSize size,
                    const cv::Scalar& colour) {
  cv::putText(picture, printable(text), {at.x, at.y + line_height_px(size) - 5}, kFont, scale_of(size),
              colours::kInk, 3, cv::LINE_AA);
  write(picture, text, at, size, colour);
}

}  // namespace q3d::pipeline::report
