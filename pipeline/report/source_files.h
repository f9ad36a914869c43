// The files that a dataset was made from, found again on this machine.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"

namespace q3d::pipeline::report {

// A published dataset names its files by SHA-256 alone. Two places know where they lie: OUT/digests.txt,
// which the build left, and the build's config. Every file is compared with its digest before it is used.
class SourceFiles {
 public:
  // `config` may be null. With it, the annotation files are read for the paths of the pictures. Throws as
  // candidates::load_configured does, and manifests::IoError.
  SourceFiles(const std::filesystem::path& output_folder, const config::BuildConfig* config);

  struct Picture {
    std::vector<std::byte> bytes;
    int orientation = 1;  // by which the record turns the stored pixels; known with a config only
  };
  // A candidate's picture. Nothing if no file with this digest is known, or if it has changed. Throws
  // manifests::IoError for a file that is there and cannot be read.
  std::optional<Picture> picture(const std::string& id, const std::string& sha256) const;

  // The body model with this digest. `given` is the user's own choice and may be empty. Nothing if no file is
  // known. Throws ConfigError if `given` has another digest. An empty `sha256` (a build without a network)
  // accepts `given` as it is, or a body model of the config.
  std::optional<std::filesystem::path> body_model(const std::string& sha256,
                                                  const std::filesystem::path& given) const;

 private:
  struct Configured {
    std::filesystem::path path;
    int orientation = 1;
  };
  std::multimap<std::string, std::filesystem::path> known_;  // by SHA-256
  std::map<std::string, Configured> configured_;             // pictures by id
  std::vector<std::filesystem::path> configured_bodies_;
};

}  // namespace q3d::pipeline::report
