// Prints the ids of a shard's samples.
#include <cstdio>

#include "manifests/shard.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  const q3d::manifests::Shard shard = q3d::manifests::read_shard(argv[1]);
  for (const auto& sample : shard.samples) std::printf("%s\n", sample.record.id.c_str());
  return 0;
}
