// Says whether this process syncs and locks its files. Some network disks support neither; --no-sync and
// --no-lock on the command line turn these off.
#pragma once

#include <filesystem>

namespace q3d::manifests {

struct Durability {
  bool syncs = true;  // finished files reach the disk before anything is built on them
  bool locks = true;  // a second build of the same folder is refused
};

// Sets the durability of the whole process. Call it before the first file is written.
void set_durability(Durability wanted);
Durability durability();

// Waits until everything that was written to the folder's file system has reached the disk, if
// durability().syncs. One call takes less time than one for each of many files. Throws IoError
// (manifests/file_descriptor.h).
void sync_file_system(const std::filesystem::path& folder);

}  // namespace q3d::manifests
