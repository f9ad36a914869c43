// The configuration of a build: one JSON file, or several laid over each other. docs/config.md explains every
// key.
#pragma once

#include <nlohmann/json.hpp>

#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "filters/calibrate.h"
#include "filters/guards.h"
#include "loaders/formats/dataset.h"
#include "manifests/image_encoding.h"
#include "pipeline/config/network_words.h"
#include "pipeline/config/role.h"

namespace q3d::pipeline::config {

// How a dataset is read, and how the build uses it.
struct DatasetConfig : loaders::formats::DatasetOptions {
  Role role = Role::pseudo;
  std::filesystem::path curation{};  // list of `curate` that names the pictures to take; empty takes all
  std::filesystem::path
      body_model{};  // checks the file's 3D keypoints (pipeline/candidates/body_check.h); empty does not
  bool keypoints_3d_of_body = false;  // labels get the body's 3D keypoints instead of the file's
  // Terms, origin and citation of pictures and annotations, for those who receive the dataset. Shards and
  // dataset.json repeat them.
  std::string licence{};
  std::string source_url{};
  std::string citation{};
  bool turns_by_exif = false;             // the labels were made on the pictures as EXIF turns them
  double max_picture_megapixels = 200.0;  // a larger picture fails before it is decoded
  bool scales_resized = false;            // labels are scaled if their pictures have been resized
};

struct NetworkConfig {
  std::filesystem::path checkpoint;  // safetensors, official parameter names
  std::filesystem::path smal_asset;  // safetensors; see smal/tensors/asset.h
  std::string device = "auto";       // auto, cpu, cuda, cuda:I, or a GPU for each rank: cuda:I,cuda:J
  Dtype dtype = Dtype::float32;
  int batch = 8;  // crops in one forward pass; batches never cross a unit
  int compute_threads =
      0;               // threads of one CPU operator; 0 = as the network's size suggests. Part of the key.
  int local_rank = 0;  // of processes that share a machine; no key of the config. It chooses the GPU.
};

struct TtaConfig {
  TtaObjective objective = TtaObjective::paper;
  double learning_rate = 1e-6;
  double aux_weight = 5.0;
  double reproj_weight = 0.5;
  double pose_prior_weight = 0.0;  // for both objectives; above 0 the priors are needed
  double shape_prior_weight = 0.0;
  int iterations_min = 10;
  int iterations_max = 60;
  double stop_below = 0.0;       // crop units; 0 = never
  bool refine_retained = false;  // also adapt samples below tau_low
  int batch = 8;
};

// Thresholds of one dataset. An absent one is the common threshold.
struct DatasetThresholds {
  std::optional<double> tau_low;  // crop units; both or none
  std::optional<double> tau_high;
  std::optional<double> delta;
};

struct FilterConfig {
  std::optional<double> tau_low;  // crop units; absent until calibrated
  std::optional<double> tau_high;
  double delta = 0.05;
  double tau_ceiling = 0.1;                           // crop units; a tau_high above it is refused
  double min_trust = 0.0;                             // least combined trust of a kept label; 0 = off
  std::map<std::string, DatasetThresholds> datasets;  // by the dataset's name
};

// The guards, which are all off by default: bounds on labels, and changes to adaptation.
struct GuardConfig : filters::GuardBounds {
  int iterations_full_at = 0;   // visible keypoints from which a sample gets all its iterations; 0 = off
  double held_out_share = 0.0;  // fraction of the visible keypoints; 0 = off
  std::uint64_t held_out_seed = 0;
  int held_out_patience = 0;     // iterations without a new least held-out error; 0 = no limit
  std::filesystem::path priors;  // pose and shape priors; empty = the checkpoint's
};

// The aims of `calibrate`.
struct CalibrateConfig : filters::TargetShares {
  bool per_dataset = false;  // thresholds for each dataset instead of common ones
};

struct ShardConfig {
  int unit_size = 512;  // candidates of one work unit = one shard
  manifests::ImageEncoding images = manifests::ImageEncoding::jpeg;
  int jpeg_quality = 95;
  double crop_scale = 1.9;  // the stored crop's side over the box's longer side
  int crop_min_side_px = 480;
};

// Pictures of the pool that are also in these sets get no pseudo label.
struct LeakageConfig {
  std::vector<DatasetConfig> test_sets;
  int max_distance = 4;  // bits of 64 in which the hashes of one picture's copies may differ
};

struct BuildConfig {
  std::string name = "quadruped3d";
  std::string version = "1.0.0";  // the user's semantic version of the dataset
  std::string profile = "paper";  // the set of guards that the config starts from; pipeline/config/profiles.h
  std::vector<DatasetConfig> datasets;
  NetworkConfig network;  // has no paths if the config names none
  TtaConfig tta;
  FilterConfig filter;
  GuardConfig guards;
  ShardConfig shards;
  CalibrateConfig calibrate;
  std::optional<LeakageConfig> leakage;
  double max_failed_share = 0.9;  // of the candidates; if more failed, a build exits with 1
  std::filesystem::path veto;     // ids to leave out (pipeline/candidates/veto.h); empty when there are none
  std::filesystem::path
      corrections;            // keypoints (pipeline/candidates/corrections.h); empty when there are none
  nlohmann::json as_written;  // the merged JSON, paths as the user wrote them
};

// Says whether a config with pseudo labels must have the key "network". `leakage` reads no network.
enum class NetworkKey : std::uint8_t { required, optional };

// Reads the files in order; a later file's keys replace an earlier one's. Relative paths are relative to the
// file that names them. `settings` are single keys on top of the files (config_override.h). Throws
// ConfigError that names file and key, what was found and what was expected.
BuildConfig load_build_config(const std::vector<std::filesystem::path>& files,
                              const std::vector<std::string>& settings = {},
                              NetworkKey network_key = NetworkKey::required);

// Reads a list of datasets in the form of the key "datasets". Paths must be absolute. Throws ConfigError.
std::vector<DatasetConfig> parse_datasets(const nlohmann::json& list, const std::string& where);

// Makes the paths of the datasets in object[key] absolute, if it is a list of datasets.
void resolve_dataset_paths(nlohmann::json& object, const char* key, const std::filesystem::path& folder);

// Checks and converts merged JSON; `where` names it in messages.
BuildConfig parse_build_config(const nlohmann::json& merged, const std::string& where,
                               NetworkKey network_key = NetworkKey::required);

// Throws ConfigError that names the first dataset without keypoints, whose predictions nothing can judge.
void require_keypoints(const BuildConfig& config);

// Returns whether a dataset has the role `pseudo`. A build that needs no network ignores `network`, `tta`,
// `filter` and `guards`.
bool needs_network(const BuildConfig& config);

// Returns whether adaptation's objective has a term of the pose or shape priors.
bool uses_priors(const TtaConfig& tta);
// Returns whether a guard that is on needs the pose and shape priors.
bool uses_priors(const GuardConfig& guards);
// Returns the file that holds the priors: the one in `guards`, else the checkpoint, whose official form also
// holds them.
std::filesystem::path priors_file(const BuildConfig& config);

}  // namespace q3d::pipeline::config
