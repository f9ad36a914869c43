// Label files of every kind, as `topology --from` reads them, and the topology that is guessed from their
// names.
#include <nlohmann/json.hpp>
#include <set>

#include "loaders/formats/label_survey.h"
#include "loaders/formats/label_table.h"
#include "loaders/keypoints/guess.h"
#include "loaders/keypoints/topology_file.h"
#include "tests/fuzz/fuzz_input.h"

namespace {

using q3d::fuzz::require;

// A guess must be a topology that a build accepts.
void check(const q3d::fuzz::Scratch& scratch, const std::vector<std::string>& names) {
  require(!names.empty(), "a survey has names");
  require(std::set<std::string>(names.begin(), names.end()).size() == names.size(),
          "each name is there once");
  const auto guess = q3d::loaders::keypoints::guess_topology("mine", names);
  const auto file = scratch.write("guess.json", topology_json(guess.topology, "guessed").dump());
  q3d::fuzz::value_or_refusal(file, [&] {
    const auto read = q3d::loaders::keypoints::read_topology_file(file);
    require(read.keypoints == names && read.source == guess.topology.source, "a guess can be read back");
  });
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const q3d::fuzz::Scratch scratch;
  for (const char* name : {"labels.json", "labels.csv"}) {
    const auto file = scratch.write(name, q3d::fuzz::as_text(data, size));
    // HDF5 is read in another process, which libFuzzer cannot see; the target label_table has it.
    if (q3d::loaders::formats::is_hdf5(file)) return 0;
    q3d::fuzz::value_or_refusal(file,
                                [&] { check(scratch, q3d::loaders::formats::survey_labels(file).names); });
  }
  return 0;
}
