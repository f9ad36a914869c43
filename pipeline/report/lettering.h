// Writes text on pictures.
#pragma once

#include <opencv2/core.hpp>

#include <string>
#include <vector>

namespace q3d::pipeline::report {

// Colours that people with any common kind of colour blindness tell apart (Okabe and Ito), as RGB.
namespace colours {
inline const cv::Scalar kBlue(86, 180, 233);
inline const cv::Scalar kOrange(240, 159, 0);
inline const cv::Scalar kYellow(240, 228, 66);
inline const cv::Scalar kWhite(255, 255, 255);
inline const cv::Scalar kInk(20, 20, 20);
inline const cv::Scalar kGrey(110, 110, 110);
inline const cv::Scalar kPaper(250, 250, 248);
inline const cv::Scalar kEmpty(226, 226, 224);  // for a panel that has nothing to show
}  // namespace colours

enum class TextSize { small, normal };

int line_height_px(TextSize size);
int text_width_px(const std::string& text, TextSize size);

// Breaks text into lines that are no wider than this. It breaks at spaces, and inside a word (an id) that is
// too long for a line. Nothing is left out.
std::vector<std::string> wrapped(const std::string& text, int width_px, TextSize size);

// Writes one line with its upper left corner at `at`. Characters beyond ASCII are shown as '?', which is all
// that OpenCV's fonts have.
void write(cv::Mat& picture, const std::string& text, cv::Point at, TextSize size,
           const cv::Scalar& colour = colours::kInk);

// Writes a line with a dark rim, so that it is readable on any background.
void write_on_photo(cv::Mat& picture, const std::string& text, cv::Point at, TextSize size,
                    const cv::Scalar& colour = colours::kWhite);

}  // namespace q3d::pipeline::report
