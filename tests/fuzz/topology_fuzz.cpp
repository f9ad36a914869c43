// Topology files: what is accepted maps mirrored keypoints onto mirrored ones.
#include "loaders/keypoints/topology_file.h"
#include "tests/fuzz/fuzz_input.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using q3d::fuzz::require;
  static const q3d::fuzz::Scratch scratch;
  const auto file = scratch.write("topology.json", q3d::fuzz::as_text(data, size));
  q3d::fuzz::value_or_refusal(file, [&] {
    const q3d::loaders::keypoints::Topology topology = q3d::loaders::keypoints::read_topology_file(file);
    const std::size_t count = topology.keypoints.size();
    require(count > 0 && topology.flip.size() == count && topology.weights.size() == count,
            "every keypoint has a mirror image and a weight");
    for (std::size_t i = 0; i < count; ++i) {
      const auto mirror = static_cast<std::size_t>(topology.flip[i]);
      require(mirror < count && topology.flip[mirror] == static_cast<int>(i),
              "mirroring twice changes nothing");
    }
    const std::vector<q3d::manifests::Keypoint> points(count);
    to_animal3d(topology, points);
  });
  return 0;
}
