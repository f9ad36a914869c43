#include "pipeline/world/world.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <stdexcept>
#include <vector>

#include "manifests/atomic_file.h"
#include "manifests/durability.h"
#include "manifests/file_descriptor.h"
#include "manifests/json_parse.h"
#include "manifests/lock.h"
#include "pipeline/animal/synthetic_files.h"
#include "pipeline/world/annotations.h"
#include "pipeline/world/picture.h"
#include "pipeline/world/plan.h"

namespace q3d::pipeline::world {
namespace {

namespace fs = std::filesystem;

constexpr int kVersion = 1;  // raise it when the same options give another world
constexpr int kChunk = 64;   // pictures whose bodies are computed together
constexpr const char* kUnfinished = ".unfinished-world";
constexpr std::array<const char*, 6> kFolders{
    "animal3d", "control_animal3dlatest", "superanimal_quadruped", "animal_kingdom", "truth", "assets"};

void check(const WorldOptions& options) {
  const auto refuse = [](const std::string& what) { throw std::invalid_argument("world: " + what); };
  if (options.out.empty()) refuse("no output folder is given");
  if (options.picture_px < 64 || options.picture_px > 2048) {
    refuse(fmt::format("picture_px is {}, expected 64 to 2048", options.picture_px));
  }
  if (!(options.share > 0.0 && options.share <= 1000.0)) {
    refuse(fmt::format("share is {}, expected more than 0 and at most 1000", options.share));
  }
  if (options.threads < 0)
    refuse(fmt::format("threads is {}, expected 0 (all cores) or more", options.threads));
}

nlohmann::json options_of(const WorldOptions& options) {
  return {{"version", kVersion},
          {"seed", options.seed},
          {"picture_px", options.picture_px},
          {"share", options.share}};
}

// Reads the results of an earlier run. Returns its counts if it is the same world and finished.
std::optional<nlohmann::json> finished_world(const WorldOptions& options) {
  const fs::path file = options.out / "world.json";
  if (!fs::exists(file)) return std::nullopt;
  const auto found = manifests::parse_json_or_null<nlohmann::json>(manifests::read_file(file));
  const bool is_whole = found.is_object() && found.contains("pictures");
  if (!is_whole || found.value("options", nlohmann::json()) != options_of(options)) {
    throw std::runtime_error(fmt::format(
        "world: {} holds another world (its options: {}; wanted: {}); choose another folder or "
        "remove this one",
        options.out.string(), !is_whole ? "unreadable" : found.value("options", nlohmann::json()).dump(),
        options_of(options).dump()));
  }
  return found.at("pictures");
}

// Removes an unfinished world. Folders without the mark of this program are never touched.
void clear_unfinished(const fs::path& out) {
  const fs::path marker = out / kUnfinished;
  for (const char* folder : kFolders) {
    if (!fs::exists(out / folder)) continue;
    if (!fs::exists(marker)) {
      throw std::runtime_error(
          fmt::format("world: {} already holds {}, which is not part of a world; choose another folder",
                      out.string(), folder));
    }
    fs::remove_all(out / folder);
  }
  manifests::write_file_atomically(marker, "a killed run of the world's renderer is made anew\n");
}

// Removes the mark durably, so that a power cut cannot bring it back.
void remove_mark(const fs::path& out) {
  if (fs::remove(out / kUnfinished)) manifests::sync_folder(out);
}

// Writes without a sync. make_world() syncs all pictures at its end, which is faster than one by one.
void write_bytes(const fs::path& path, std::span<const std::uint8_t> bytes) {
  manifests::FileDescriptor file(path, O_WRONLY | O_CREAT | O_TRUNC);
  file.write_all(std::as_bytes(bytes));
  file.close();
}

void write_json(const fs::path& path, const nlohmann::json& content) {
  fs::create_directories(path.parent_path());
  manifests::write_file_atomically(path, content.dump());
}

void save_asset(const BodyModel& model, const fs::path& path) {
  if (path.has_parent_path()) fs::create_directories(path.parent_path());
  model.save(path);
}

// Saves the priors of the world's bodies, for the guards and trust scores that need them.
void save_priors(const fs::path& out) {
  const fs::path path = out / "assets" / "priors_synthetic.safetensors";
  if (fs::exists(path)) return;
  fs::create_directories(path.parent_path());
  animal::write_synthetic_priors(path);
}

std::string split_name(const PicturePlan& plan) {
  return fmt::format("{}/{}", domain_of(plan.set).folder, plan.test ? "test" : "train");
}

void write_annotations(const fs::path& out, SetId set, bool test, std::span<const FinishedPicture> pictures,
                       const std::vector<Landmark>& superanimal) {
  const std::string folder(domain_of(set).folder), split = test ? "test" : "train";
  switch (set) {
    case SetId::animal3d:
    case SetId::ctrlani3d:
      write_json(out / folder / (split + ".json"),
                 prima_annotations(pictures, fmt::format("Rendered quadrupeds in the format of {}, {} set",
                                                         folder, split)));
      return;
    case SetId::superanimal:
      write_json(out / folder / "annotations" / (split + ".json"),
                 superanimal_annotations(pictures, superanimal));
      break;
    case SetId::animal_kingdom:
      write_json(out / folder / "annotation" / "ak_P3_mammal" / (split + ".json"),
                 animal_kingdom_annotations(pictures));
      break;
  }
  write_json(out / "truth" / fmt::format("{}_{}.json", folder, split), truth_annotations(pictures));
}

class Run {
 public:
  explicit Run(const WorldOptions& options)
      : options_(options),
        arena_(options.threads == 0 ? tbb::task_arena::automatic : options.threads),
        renderer_(options.seed, options.picture_px) {}

  const BodyModel& model() const { return renderer_.model(); }

  WorldSummary all() {
    std::vector<std::vector<PicturePlan>> splits;
    WorldSummary summary;
    for (int set = 0; set < kSets; ++set) {
      for (const bool test : {false, true}) {
        splits.push_back(plan_split(static_cast<SetId>(set), test, options_.share, options_.seed));
        summary.total += static_cast<int>(splits.back().size());
      }
    }
    total_ = summary.total;
    for (const auto& plans : splits) {
      if (plans.empty()) continue;
      summary.pictures[split_name(plans.front())] = static_cast<int>(plans.size());
      const std::vector<FinishedPicture> finished = render(plans);
      write_annotations(options_.out, plans.front().set, plans.front().test, finished,
                        renderer_.landmarks(SetId::superanimal));
    }
    return summary;
  }

 private:
  std::vector<FinishedPicture> render(std::span<const PicturePlan> plans) {
    std::vector<FinishedPicture> finished;
    for (std::size_t begin = 0; begin < plans.size(); begin += kChunk) {
      const auto chunk = plans.subspan(begin, std::min<std::size_t>(kChunk, plans.size() - begin));
      std::vector<Picture> pictures;
      arena_.execute([&] { pictures = renderer_.render(chunk); });
      for (std::size_t i = 0; i < chunk.size(); ++i) {
        store(chunk[i], pictures[i]);
        finished.push_back({chunk[i], std::move(pictures[i].truth)});
      }
      done_ += static_cast<int>(chunk.size());
      if (options_.progress) options_.progress(done_, total_);
    }
    return finished;
  }

  void store(const PicturePlan& plan, const Picture& picture) const {
    const fs::path image = options_.out / domain_of(plan.set).folder / plan.image;
    const fs::path mask = options_.out / plan.mask;
    fs::create_directories(image.parent_path());
    fs::create_directories(mask.parent_path());
    write_bytes(image, picture.jpeg);
    write_bytes(mask, picture.mask_png);
  }

  const WorldOptions& options_;
  tbb::task_arena arena_;
  PictureRenderer renderer_;
  int done_ = 0, total_ = 0;
};

}  // namespace

WorldSummary make_world(const WorldOptions& options) {
  check(options);
  fs::create_directories(options.out);
  const manifests::FolderLock lock(options.out);
  manifests::remove_temporaries(options.out);
  const fs::path asset =
      options.asset.empty() ? options.out / "assets" / "smal_synthetic.safetensors" : options.asset;
  if (const auto pictures = finished_world(options)) {
    WorldSummary summary{
        .pictures = pictures->get<std::map<std::string, int>>(), .reused = true, .asset = asset};
    for (const auto& [split, count] : summary.pictures) summary.total += count;
    if (!fs::exists(asset)) save_asset(BodyModel(), asset);
    save_priors(options.out);
    remove_mark(options.out);  // the run that finished the world was killed before this step
    return summary;
  }
  clear_unfinished(options.out);
  Run run(options);
  save_asset(run.model(), asset);
  save_priors(options.out);
  WorldSummary summary = run.all();
  summary.asset = asset;
  manifests::sync_file_system(options.out);
  write_json(options.out / "world.json", {{"options", options_of(options)}, {"pictures", summary.pictures}});
  remove_mark(options.out);
  return summary;
}

}  // namespace q3d::pipeline::world
