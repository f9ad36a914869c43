#include "pipeline/leakage/leakage_page.h"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <opencv2/imgproc.hpp>
#include <span>
#include <vector>

#include "loaders/pictures/encode.h"
#include "loaders/pictures/image.h"
#include "manifests/atomic_file.h"
#include "pipeline/figure/svg.h"

namespace q3d::pipeline::leakage {
namespace {

constexpr std::size_t kMaxPairs = 100;
constexpr std::size_t kMaxGroups = 50;
constexpr std::size_t kMaxOfGroup = 6;
constexpr int kThumbnailPx = 180;  // the longer side
constexpr int kJpegQuality = 80;

constexpr const char* kStyle =
    "body{font:15px/1.4 sans-serif;margin:2em;background:#f6f6f4;color:#222}"
    ".row{display:flex;flex-wrap:wrap;gap:12px;background:#fff;border:1px solid #ddd;padding:12px;margin:0 0 "
    "12px}figure{margin:0;width:200px}figcaption{font-size:12px;overflow-wrap:anywhere}"
    ".why{width:100%;font-weight:600}";

std::string base64(std::span<const std::byte> bytes) {  // RFC 4648
  constexpr std::string_view kDigits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    unsigned group = 0;
    for (std::size_t j = 0; j < 3; ++j) {
      group = group << 8U | (j < count ? std::to_integer<unsigned>(bytes[i + j]) : 0U);
    }
    for (std::size_t j = 0; j < 4; ++j) {
      text += j <= count ? kDigits[group >> (18U - 6U * static_cast<unsigned>(j)) & 63U] : '=';
    }
  }
  return text;
}

struct Figure {
  std::string path;
  std::string caption;
};

std::string figure_html(const Figure& figure) {
  const loaders::pictures::DecodedImage image =
      loaders::pictures::decode_image(std::filesystem::path(figure.path));
  std::string picture = "<p>(cannot be read)</p>";
  if (image.failure == manifests::Reason::none) {
    const double scale =
        std::min(1.0, static_cast<double>(kThumbnailPx) / std::max(image.rgb.cols, image.rgb.rows));
    const cv::Size size(std::max(1, cvRound(image.rgb.cols * scale)),
                        std::max(1, cvRound(image.rgb.rows * scale)));
    cv::Mat small;
    cv::resize(image.rgb, small, size, 0, 0, cv::INTER_AREA);
    picture = fmt::format("<img src=\"data:image/jpeg;base64,{}\" alt=\"\">",
                          base64(loaders::pictures::encode_jpeg(small, kJpegQuality)));
  }
  return fmt::format("<figure>{}<figcaption>{}</figcaption></figure>", picture,
                     figure::escaped(figure.caption));
}

struct Row {
  std::string why;
  std::vector<Figure> figures;
};

// Returns one row for each picture of the pool, in which several animals are several leaks.
std::vector<Row> leak_rows(const LeakageReport& report, const candidates::Ingest& pool) {
  std::vector<Row> rows;
  std::string before;
  for (const Leak& leak : report.leaks) {
    if (rows.size() == kMaxPairs) break;
    const manifests::SampleRecord record = pool.candidates.at(leak.candidate).record;
    if (record.image_path == before) continue;
    before = record.image_path;
    rows.push_back({fmt::format("{}: {}", to_string(leak.evidence), leak.detail),
                    {{record.image_path, record.id}, {leak.test_path, leak.test_id}}});
  }
  return rows;
}

std::vector<Row> group_rows(const LeakageReport& report, const candidates::Ingest& pool) {
  std::vector<Row> rows;
  for (const auto& group : report.groups) {
    if (rows.size() == kMaxGroups) break;
    Row& row = rows.emplace_back();
    row.why = fmt::format("{} pictures", group.size());
    for (std::size_t i = 0; i < std::min(group.size(), kMaxOfGroup); ++i) {
      const manifests::SampleRecord record = pool.candidates.at(group[i]).record;
      row.figures.push_back({record.image_path, record.id});
    }
  }
  return rows;
}

std::string rows_html(const std::vector<Row>& rows) {
  std::vector<std::string> parts(rows.size());
  tbb::parallel_for(std::size_t{0}, rows.size(), [&](std::size_t i) {
    parts[i] = fmt::format("<div class=\"row\"><div class=\"why\">{}</div>", figure::escaped(rows[i].why));
    for (const Figure& figure : rows[i].figures) parts[i] += figure_html(figure);
    parts[i] += "</div>\n";
  });
  std::string html;
  for (const std::string& part : parts) html += part;
  return html;
}

}  // namespace

void write_leakage_page(const std::filesystem::path& file, const LeakageReport& report,
                        const candidates::Ingest& pool) {
  const std::vector<Row> leaks = leak_rows(report, pool);
  const std::vector<Row> groups = group_rows(report, pool);
  const std::string html = fmt::format(
      "<!doctype html>\n<html lang=\"en\"><meta charset=\"utf-8\"><title>Leakage</title><style>{}</style>\n"
      "<h1>Pictures of the pool that are in a test set</h1>\n"
      "<p>{} of {} candidates; left the pool's picture, right the test set's. Shown: {}; leaks.csv lists "
      "all.</p>\n{}"
      "<h1>Pictures of the pool that look alike</h1>\n"
      "<p>{} groups of {} pictures. Shown: {} groups, the first {} of each; duplicates.csv lists all.</p>\n{}"
      "</html>\n",
      kStyle, report.leaks.size(), pool.candidates.size(), leaks.size(), rows_html(leaks),
      report.groups.size(), report.summary.in_groups, groups.size(), kMaxOfGroup, rows_html(groups));
  manifests::write_file_atomically(file, html);
}

}  // namespace q3d::pipeline::leakage
