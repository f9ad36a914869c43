// The folder that an export fills. It holds only complete files, an export can be resumed, and the manifest
// is written last.
#pragma once

#include <nlohmann/json.hpp>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "manifests/journal.h"
#include "manifests/lock.h"

namespace q3d::pipeline::exports {

// While an export runs, its folder holds `.parts`: a lock, what is exported, and the finished units' records
// with their journal. `export.json` exists when the export is complete; `.parts` is gone then.
class ExportFolder {
 public:
  struct File {
    std::string sha256;
    std::size_t bytes = 0;
  };
  using Files = std::map<std::string, File>;  // by their names in the folder

  // `about` says what is exported and how; equal exports must have an equal `about`. Throws run::ConfigError
  // if the folder holds another export or other files, and std::runtime_error if another export writes there
  // or a file of a complete export, pictures included, is gone or damaged.
  ExportFolder(std::filesystem::path out, nlohmann::ordered_json about);

  const std::filesystem::path& path() const { return out_; }
  bool is_complete() const { return complete_; }
  // Returns the content of export.json of a complete export.
  const nlohmann::ordered_json& manifest() const { return manifest_; }

  // Writes a picture or mask. The unit's part lists it, and through it the manifest. Thread-safe.
  File write_picture(const std::string& name, std::span<const std::byte> content) const;
  // Returns whether the unit has a part, which holds its records and lists their pictures. A part does not
  // count if it has another input digest, or if it or one of its pictures is gone or damaged.
  bool has_part(std::int64_t unit, const std::string& input_digest);
  void save_part(std::int64_t unit, const std::string& input_digest, std::int64_t rows, std::string_view text,
                 const Files& pictures);
  // Returns the records of a unit that has a part, and takes its pictures into the manifest. Throws
  // std::runtime_error if the part is damaged.
  std::string take_part(std::int64_t unit);

  // Writes an annotation file or metadata, and the folders that lead to it. The manifest lists it.
  void write(const std::string& name, std::string_view content);
  // Like write(), for a picture that belongs to no unit.
  void write_common_picture(const std::string& name, std::span<const std::byte> content);
  // Writes the manifest, with `summary` in it, and removes the parts.
  void finish(const nlohmann::ordered_json& summary);

  const Files& files() const { return files_; }

 private:
  bool open_complete();
  bool is_whole(const std::filesystem::path& part, const std::string& sha256) const;
  void open_parts();
  void drop_parts();
  void check_same(const nlohmann::ordered_json& found, const std::filesystem::path& file) const;

  std::filesystem::path out_;
  std::filesystem::path parts_;
  nlohmann::ordered_json about_;
  nlohmann::ordered_json manifest_;
  bool complete_ = false;
  std::unique_ptr<manifests::FolderLock> lock_;
  std::unique_ptr<manifests::Journal> journal_;
  Files files_;
  Files pictures_;
};

}  // namespace q3d::pipeline::exports
