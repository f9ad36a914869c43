// The files of `evaluate` and `evaluate-labels`, and the world's hidden truth. The first byte of an input
// says which: e evaluation.json and samples.csv, l labels.json and labels.csv (parted by 0x1E), t the truth.
#include <cmath>

#include "pipeline/evaluation/evaluation_files.h"
#include "pipeline/evaluation/hidden_truth.h"
#include "pipeline/evaluation/label_files.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;
using q3d::fuzz::Scratch;
namespace evaluation = q3d::pipeline::evaluation;

// A refusal names one of the folder's two files, both of which begin with `stem`.
template <typename Read>
void value_or_named_file(const std::string& folder, const Read& read) {
  try {
    read();
  } catch (const std::runtime_error& error) {
    require(std::string_view(error.what()).find(folder) != std::string_view::npos, "a refusal names the file",
            error.what());
  }
}

void read_evaluation(const Scratch& scratch, std::string_view bytes) {
  const auto [description, samples] = q3d::fuzz::two_files(bytes);
  const auto file = scratch.write("evaluation/evaluation.json", description);
  scratch.write("evaluation/samples.csv", samples);
  value_or_named_file("evaluation/", [&] {
    const auto read = evaluation::read_evaluation(file);
    require(read.datasets.size() <= read.dataset_names.size(), "every dataset has a name");
  });
}

void read_labels(const Scratch& scratch, std::string_view bytes) {
  const auto [description, labels] = q3d::fuzz::two_files(bytes);
  const auto file = scratch.write("labels/labels.json", description);
  scratch.write("labels/labels.csv", labels);
  value_or_named_file("labels/", [&] { evaluation::read_label_evaluation(file.parent_path()); });
}

void read_truth(const Scratch& scratch, std::string_view bytes) {
  const auto file = scratch.write("truth.json", bytes);
  for (const auto& masks : {std::filesystem::path(), scratch.root()}) {
    q3d::fuzz::value_or_refusal(file, [&] {
      const evaluation::HiddenTruth truth(file, masks);
      std::vector<q3d::manifests::SampleRecord> records(1);
      records.front().image_ref = "a.jpg";
      require(truth.complete(records) <= 1, "one record lacks its truth at most");
      for (const float number :
           records.front().truth ? records.front().truth->betas : decltype(records.front().truth->betas){}) {
        require(!std::isnan(number), "a truth is of numbers");
      }
      const std::string& mask = records.front().mask_path;
      require(mask.empty() || mask.starts_with(scratch.root().string()), "a mask lies below its folder",
              mask);
    });
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const Scratch scratch;
  static const auto mask = scratch.write("mask.png", "");
  const auto [reader, bytes] = q3d::fuzz::chosen_reader(data, size);
  if (reader == 'e') read_evaluation(scratch, bytes);
  if (reader == 'l') read_labels(scratch, bytes);
  if (reader == 't') read_truth(scratch, bytes);
  return 0;
}
