// `overlay`: writes pictures and 3D files of chosen candidates.
#pragma once

#include <filesystem>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "pipeline/config/build_config.h"
#include "pipeline/device/body_meshes.h"
#include "pipeline/report/overlay_choice.h"
#include "pipeline/report/overlay_painter.h"

namespace q3d::pipeline::report {

struct OverlayOptions {
  std::filesystem::path dataset;              // a version's folder, or an output folder
  std::optional<config::BuildConfig> config;  // the build's, where pictures or the body are not found
  std::filesystem::path body;                 // body model; empty: the one that the dataset was made with
  Choice choice;
  std::vector<Panel> panels{kAllPanels.begin(), kAllPanels.end()};
  bool captions = true;
  std::filesystem::path folder;  // folder for one PNG for each candidate; empty: none
  std::filesystem::path sheet;   // file for one PNG of all; empty: none
  int columns = 1;               // of the sheet
  bool obj = false;              // into the folder
  bool glb = false;
};

struct OverlaySummary {
  std::vector<std::string> ids;           // of the candidates that were drawn
  std::size_t files = 0;                  // written
  std::vector<std::string> without_body;  // ids for which --obj and --glb had nothing to write
};

// Returns a name for the files of a candidate: its id in characters that every file system accepts, and some
// digits of the id's SHA-256, because two ids may become the same characters.
std::string file_stem(const std::string& id);

// Says that the body model of a dataset was not found, and what to do.
class MissingBodyModel : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

// Returns the path of a dataset's body model. Throws MissingBodyModel, and as SourceFiles::body_model does.
std::filesystem::path find_body_model(const dataset::PublishedDataset& dataset, const SourceFiles& files,
                                      const std::filesystem::path& given);

// Draws the chosen candidates and writes the requested files, each completely or not at all. Throws
// ConfigError for a choice that makes no sense and std::runtime_error if no candidate was chosen.
OverlaySummary draw_overlays(const OverlayOptions& options, const device::BodyMeshesLoader& load_bodies);

}  // namespace q3d::pipeline::report
