#include "pipeline/evaluation/paper_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string_view>
#include <vector>

namespace q3d::pipeline::evaluation {
namespace {

using Numbers = std::vector<std::optional<double>>;

// A row of the paper, by the table's columns.
struct PaperRow {
  const char* method;
  Numbers numbers;
};

// A column shows a metric of a dataset, or of one of its families.
struct Column {
  const char* title;
  const char* dataset;
  Metric metric;
  const char* family = "";
};

struct PaperTable {
  const char* title;
  std::vector<Column> columns;
  std::vector<PaperRow> rows;
  const char* note;
};

constexpr auto kNone = std::nullopt;
constexpr const char* kOurs = "this evaluation";

const std::vector<PaperTable>& tables_of_the_paper() {
  static const std::vector<PaperTable> kTables{
      {"Sets with bodies (the paper's table 1)",
       {{"Animal3D AUC", "animal3d", Metric::auc},
        {"PAJ", "animal3d", Metric::pa_mpjpe},
        {"PAV", "animal3d", Metric::pa_mpvpe},
        {"CtrlAni3D AUC", "ctrlani3d", Metric::auc},
        {"PAJ", "ctrlani3d", Metric::pa_mpjpe},
        {"PAV", "ctrlani3d", Metric::pa_mpvpe}},
       {{"HMR", {76.3, 123.5, 133.9, 80.8, 123.5, 133.9}},
        {"WLDO", {78.2, 112.3, 125.2, 88.7, 71.5, 83.4}},
        {"HMR2.0", {86.7, 94.1, 98.5, 91.8, 60.9, 66.4}},
        {"GenZoo", {86.6, 138.5, kNone, 92.9, 116.4, kNone}},
        {"AniMer", {88.9, 80.4, 85.7, 93.8, 44.1, 47.6}},
        {"AniMer+", {88.9, 78.0, 82.7, 93.6, 47.8, 50.8}},
        {"PRIMA, Stage 1", {89.6, 75.3, 79.5, 94.0, 40.1, 42.8}},
        {"PRIMA, Stage 3", {89.9, 74.7, 79.4, 94.2, 40.1, 42.7}}},
       "AUC is normalised by the mask where there is one, as in the paper."},
      {"Sets with 2D keypoints (table 2)",
       {{"Quadruped2D AUC", "superanimal", Metric::auc},
        {"P@0.1", "superanimal", Metric::pck_10},
        {"P@0.15", "superanimal", Metric::pck_15},
        {"Animal Kingdom AUC", "animal_kingdom", Metric::auc},
        {"P@0.1", "animal_kingdom", Metric::pck_10},
        {"P@0.15", "animal_kingdom", Metric::pck_15}},
       {{"AniMer", {87.6, 63.8, 78.6, 82.9, 34.9, 54.7}},
        {"AniMer+", {86.7, 60.7, 76.8, 82.6, 34.2, 53.0}},
        {"PRIMA, Stage 1", {92.0, 79.8, 90.0, 83.9, 38.9, 57.8}},
        {"PRIMA, Stage 3", {92.5, 83.5, 91.1, 83.7, 37.8, 57.3}}},
       "Real sets of this kind have no masks: then 2D numbers are normalised by the whole crop and come out "
       "higher than by the mask. The summary names the normaliser of each row."},
      {"Ablations (table 3); evaluate a network that was trained with `network.without` to fill the last row",
       {{"Animal3D PAJ", "animal3d", Metric::pa_mpjpe},
        {"PAV", "animal3d", Metric::pa_mpvpe},
        {"CtrlAni3D PAJ", "ctrlani3d", Metric::pa_mpjpe},
        {"PAV", "ctrlani3d", Metric::pa_mpvpe},
        {"Quadruped2D AUC", "superanimal", Metric::auc},
        {"P@0.1", "superanimal", Metric::pck_10},
        {"Animal Kingdom AUC", "animal_kingdom", Metric::auc},
        {"P@0.1", "animal_kingdom", Metric::pck_10}},
       {{"without F_bio", {75.5, 79.7, 43.5, 46.2, 91.7, 78.5, 83.6, 37.3}},
        {"without beta_init", {75.6, 80.1, 41.8, 44.4, 91.9, 78.9, 83.4, 36.1}},
        {"without T_keypoint", {75.6, 80.2, 43.5, 46.2, 91.1, 75.9, 83.7, 37.0}},
        {"PRIMA, Stage 1", {75.3, 79.5, 40.1, 42.8, 92.0, 79.8, 83.9, 38.9}}},
       "The paper's rows come from one training each; compare differences between rows, not rows."},
      {"By family, Animal3D (supplement)",
       {{"Equidae PAJ", "animal3d", Metric::pa_mpjpe, "equidae"},
        {"PAV", "animal3d", Metric::pa_mpvpe, "equidae"},
        {"Canidae PAJ", "animal3d", Metric::pa_mpjpe, "canidae"},
        {"PAV", "animal3d", Metric::pa_mpvpe, "canidae"},
        {"Felidae PAJ", "animal3d", Metric::pa_mpjpe, "felidae"},
        {"PAV", "animal3d", Metric::pa_mpvpe, "felidae"},
        {"Bovidae PAJ", "animal3d", Metric::pa_mpjpe, "bovidae"},
        {"PAV", "animal3d", Metric::pa_mpvpe, "bovidae"},
        {"Hippopotamidae PAJ", "animal3d", Metric::pa_mpjpe, "hippopotamidae"},
        {"PAV", "animal3d", Metric::pa_mpvpe, "hippopotamidae"}},
       {{"AniMer", {72.2, 77.8, 69.5, 72.1, 118.6, 122.1, 78.2, 78.2, 84.2, 103.9}},
        {"AniMer+", {75.1, 81.1, 68.5, 72.9, 118.0, 120.1, 80.0, 80.3, 98.4, 118.5}},
        {"PRIMA, Stage 1", {70.8, 76.5, 68.6, 71.5, 117.7, 118.8, 73.3, 75.3, 86.3, 105.8}},
        {"PRIMA, Stage 3", {70.3, 76.8, 68.3, 71.5, 115.5, 118.6, 71.1, 73.1, 89.7, 108.4}}},
       "A family with few pictures has a wide interval; `compare` gives it for two networks."},
  };
  return kTables;
}

// Returns the part of "name/split" before the slash. The paper's Quadruped2D is a part of SuperAnimal.
std::string_view name_of(const std::string& dataset) {
  const std::string_view name = std::string_view(dataset).substr(0, dataset.find('/'));
  return name == "quadruped2d" ? std::string_view("superanimal") : name;
}

const TableRow* find_row(const std::vector<TableRow>& rows, std::string_view dataset, std::string_view group,
                         bool is_adapted) {
  const auto found = std::find_if(rows.begin(), rows.end(), [&](const TableRow& row) {
    const bool is_whole_adaptation = row.setting->iterations > 0 && row.setting->visible_share == 1.0 &&
                                     row.setting->name.starts_with("TTA");
    return name_of(row.dataset) == dataset && row.group == group &&
           (is_adapted ? is_whole_adaptation : row.setting->name == "prediction");
  });
  return found == rows.end() ? nullptr : &*found;
}

std::optional<double> value_of(const Tables& tables, const Column& column, bool is_adapted = false) {
  const std::string_view family = column.family;
  const TableRow* row =
      find_row(family.empty() ? tables.datasets : tables.families, column.dataset, family, is_adapted);
  return row == nullptr ? std::nullopt : row->metrics[index_of(column.metric)].mean;
}

std::string line(const std::vector<std::string>& cells) {
  std::string text = "|";
  for (const std::string& cell : cells) text += " " + cell + " |";
  return text + "\n";
}

std::string line(const char* method, const Numbers& numbers, int decimals = 1) {
  std::vector<std::string> cells{method};
  for (const std::optional<double>& number : numbers) {
    cells.push_back(number ? fmt::format("{:.{}f}", *number, decimals) : "-");
  }
  return line(cells);
}

std::string head(const std::string& title, const std::vector<std::string>& columns) {
  std::string text = fmt::format("## {}\n\n", title) + line(columns) + "|";
  for (std::size_t i = 0; i < columns.size(); ++i) text += "---|";
  return text + "\n";
}

std::string show(const PaperTable& table, const Tables& tables) {
  std::vector<std::string> titles{"method"};
  Numbers ours;
  for (const Column& column : table.columns) {
    titles.emplace_back(column.title);
    ours.push_back(value_of(tables, column));
  }
  std::string text = head(table.title, titles);
  for (const PaperRow& row : table.rows) text += line(row.method, row.numbers);
  return text + line(kOurs, ours) + "\n" + table.note + "\n\n";
}

std::string show_adaptation(const Tables& tables) {
  Numbers ours;
  for (const Metric metric : {Metric::pa_mpjpe, Metric::pa_mpvpe, Metric::auc}) {
    for (const bool is_adapted : {false, true}) {
      ours.push_back(value_of(tables, {"", "animal3d", metric}, is_adapted));
    }
  }
  return head("Before and after test-time adaptation, Animal3D (table 4)",
              {"method", "PAJ before", "after", "PAV before", "after", "AUC before", "after"}) +
         line("PRIMA, Stage 1", {75.3, 71.7, 79.5, 75.9, 89.6, 91.5}) + line(kOurs, ours) +
         "\nThe paper adapts 10 to 60 iterations by the error of the sample; `--tta N` takes N for all. "
         "Adaptation sees the test keypoints, so its AUC flatters it.\n\n";
}

std::string show_clusters(const Tables& tables) {
  std::optional<double> ours;
  std::optional<double> truth;
  for (const ClusterRow& row : tables.clusters) {
    if (name_of(row.dataset) != "animal3d") continue;
    if (row.setting == nullptr) truth = row.ari;
    if (row.setting != nullptr && row.setting->name == "prediction") ours = row.ari;
  }
  return head("Agreement of shapes with families, Animal3D (ARI)", {"shapes", "ARI"}) +
         line("AniMer", {0.82}, 2) + line("AniMer+", {0.61}, 2) + line("PRIMA", {0.98}, 2) +
         line("the paper's true shapes", {0.99}, 2) + line(kOurs, {ours}, 2) +
         line("this evaluation's true shapes", {truth}, 2) +
         "\nk-means with five clusters. The paper does not state its clustering; compare with the true "
         "shapes of the same row.\n";
}

}  // namespace

std::string paper_tables(const Tables& tables, bool is_rendered) {
  std::string text =
      "# The paper's tables\n\nPAJ is PA-MPJPE and PAV PA-MPVPE in mm, AUC and PCK are in %.\n\n";
  text += is_rendered
              ? "**The pictures of this evaluation are rendered, and the paper's are not: its numbers "
                "stand here for the layout. Nothing in these tables may be compared across.**\n\n"
              : "The rows may be compared where the test pictures are those of the paper.\n\n";
  for (const PaperTable& table : tables_of_the_paper()) text += show(table, tables);
  return text + show_adaptation(tables) + show_clusters(tables);
}

}  // namespace q3d::pipeline::evaluation
