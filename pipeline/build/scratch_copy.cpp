#include "pipeline/build/scratch_copy.h"

#include <stdlib.h>  // mkdtemp

#include <cerrno>
#include <string>
#include <system_error>

namespace q3d::pipeline::build {

ScratchCopy::ScratchCopy(const std::filesystem::path& out) {
  std::string name = (std::filesystem::temp_directory_path() / "quadruped3d-XXXXXX").string();
  if (mkdtemp(name.data()) == nullptr) {
    throw std::system_error(errno, std::generic_category(), name + ": cannot make a temporary folder");
  }
  folder_ = name;
  for (const char* cache : {"digests.txt", "picture_hashes.txt"}) {
    if (std::filesystem::exists(out / cache)) std::filesystem::copy_file(out / cache, folder_ / cache);
  }
}

ScratchCopy::~ScratchCopy() {
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
}

}  // namespace q3d::pipeline::build
