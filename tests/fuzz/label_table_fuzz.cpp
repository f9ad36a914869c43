// DeepLabCut's files: HDF5 and CSV, told apart by content.
#include "loaders/formats/dataset.h"
#include "loaders/formats/label_table.h"
#include "tests/fuzz/fuzz_input.h"

// HDF5 1.10 leaks memory of its own when it refuses a damaged file.
extern "C" const char* __lsan_default_suppressions() {
  return "leak:libhdf5";
}

// It also reads beyond its buffers on some files (loaders/formats/label_hdf5.cpp says what is done about it).
// Without these options no run would find anything else.
extern "C" const char* __asan_default_suppressions() {
  return "interceptor_via_lib:libhdf5";
}

namespace {

void check_whole(const q3d::loaders::formats::LabelTable& table) {
  q3d::fuzz::require(table.values.size() == table.rows.size() * table.columns.size(), "a table is whole");
}

// These are the topologies of the tables in tests/data/deeplabcut.
constexpr const char* kTopology = R"({"name": "goats", "keypoints": ["eye_l", "eye_r", "snout", "horn"],
  "flip_pairs": [["eye_l", "eye_r"]],
  "animal3d26": {"left_eye": "eye_l", "right_eye": "eye_r", "nose": "snout"}})";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  static const q3d::fuzz::Scratch scratch;
  static const auto topology = scratch.write("topology.json", kTopology);
  const auto file = scratch.write("labels.h5", q3d::fuzz::as_text(data, size));
  q3d::loaders::formats::DatasetOptions options{.name = "lab",
                                                .format = "deeplabcut",
                                                .split = "train",
                                                .root = scratch.root(),
                                                .annotations = "labels.h5",
                                                .images = {}};
  options.topology = topology;
  q3d::fuzz::value_or_refusal(file, [&] {
    if (q3d::loaders::formats::is_hdf5(file)) {
      check_whole(q3d::loaders::formats::read_label_hdf5_here(file));
      return;
    }
    check_whole(q3d::loaders::formats::read_label_table(file));
    for (const auto& record : load_dataset(options).records) {
      require(!record.id.empty(), "a record has an id");
    }
  });
  return 0;
}
