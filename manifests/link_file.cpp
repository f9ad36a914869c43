#include "manifests/link_file.h"

#include "manifests/atomic_file.h"

namespace q3d::manifests {
namespace {

namespace fs = std::filesystem;

constexpr fs::perms kReadOnly = fs::perms::owner_read | fs::perms::group_read | fs::perms::others_read;

}  // namespace

void link_or_copy(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (!fs::equivalent(from, to, error)) {
    const fs::path temporary = to.string() + ".tmp";
    fs::remove(temporary, error);
    fs::create_hard_link(from, temporary, error);
    if (error) {
      fs::copy_file(from, temporary, fs::copy_options::overwrite_existing);
      // The copy has the permissions of its source, which nobody may write, but it has to be opened once
      // more.
      fs::permissions(temporary, fs::perms::owner_write, fs::perm_options::add);
      commit_file(temporary, to);
    } else {
      fs::rename(temporary, to);  // the bytes are durable already
    }
  }
  fs::permissions(to, kReadOnly, error);  // an ordinary user cannot change it
}

}  // namespace q3d::manifests
