// Writes the fixture shard to the path in argv[1] and prints its SHA-256.
#include <iostream>

#include "tests/manifests/shard_fixture.h"

int main(int argc, char** argv) {
  if (argc != 2) return 2;
  std::cout << q3d::manifests::write_shard(argv[1], q3d::testing::make_shard_header(),
                                           q3d::testing::make_shard_samples());
  return 0;
}
