// Finds the files from which a dataset was made on this machine.
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"

namespace q3d::pipeline::report {

// A published dataset names its files by SHA-256 only. Their paths come from OUT/digests.txt, which the build
// wrote, and from the build's config. Every file is compared with its digest before it is used.
class SourceFiles {
 public:
  // `config` may be null. With it, the annotation files are read for the paths of the pictures. Throws as
  // candidates::load_configured does, and manifests::IoError.
  SourceFiles(const std::filesystem::path& output_folder, const config::BuildConfig* config);

  struct Picture {
    std::vector<std::byte> bytes;
    int orientation = 1;  // by which the record turns the stored pixels; known with a config only
  };
  // Returns a candidate's picture, or nothing if no file with this digest is known or the file has changed.
  // Throws manifests::IoError for a file that exists and cannot be read.
  std::optional<Picture> picture(const std::string& id, const std::string& sha256) const;

  // Returns the body model with this digest, or nothing if no such file is known. `given` is the user's own
  // choice and may be empty. Throws ConfigError if `given` has another digest. An empty `sha256` (a build
  // without a network) accepts `given` as it is, or a body model of the config.
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
