#include "pipeline/world/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "pipeline/world/superanimal_source.h"

namespace q3d::pipeline::world {
namespace {

constexpr int kFramesPerFilm = 4;

enum Purpose : std::uint64_t { order = 1, naming = 2 };

std::string with_underscores(std::string_view name) {
  std::string result(name);
  std::replace(result.begin(), result.end(), ' ', '_');
  return result;
}

// Returns the COCO class of a species. Some pictures of Animal3D come from COCO, including all species that
// ImageNet lacks.
std::string_view coco_class(const Species& species) {
  if (species.name == "horse" || species.name == "zebra" || species.name == "cow" ||
      species.name == "sheep") {
    return species.name;
  }
  return "";
}

// Returns a file name. The numbers of each set and split differ, so that no two files seem to be the same
// photograph.
std::string animal3d_name(const PicturePlan& plan, const Species& species, manifests::Rng& rng) {
  const std::string folder =
      fmt::format("images/{}/{}", plan.test ? "test" : "train", with_underscores(species.name));
  const int number = 2 * plan.index + (plan.test ? 1 : 0);
  const std::string_view coco = coco_class(species);
  if (!coco.empty() && (coco == "cow" || rng.chance(0.4)))
    return fmt::format("{}/{:012d}_{}.jpg", folder, 100000 + number, coco);
  return fmt::format("{}/{}_{}.JPEG", folder, species.synset, 1000 + number);
}

std::string ctrlani3d_name(const PicturePlan& plan, const Species& species) {
  const std::string name = with_underscores(species.name);
  return fmt::format("images/{}/{}/{}_{:05d}.jpg", plan.test ? "test" : "train", name, name,
                     2 * plan.index + (plan.test ? 1 : 0));
}

// Returns a file name as in Animal Kingdom, where films have names of eight letters and frames have numbers.
std::string kingdom_name(const PicturePlan& plan, std::uint64_t seed) {
  manifests::Rng film(
      seed, {static_cast<std::uint64_t>(plan.set), naming, static_cast<std::uint64_t>(plan.individual)});
  std::string name;
  for (int letter = 0; letter < 5; ++letter) name += static_cast<char>('A' + film.below(26));
  for (int rest = plan.individual, letter = 0; letter < 3; ++letter, rest /= 26) {
    name += static_cast<char>('A' + rest % 26);  // unique
  }
  const int frame = 1 + 25 * (plan.index % kFramesPerFilm) + film.below(25);
  return fmt::format("dataset/{}/{}_f{:06d}.jpg", name, name, frame);
}

// Sets the picture's name in the annotation file, and the path of the mask.
void complete_paths(PicturePlan& plan) {
  const std::string_view folder = domain_of(plan.set).folder;
  const auto without = [](std::string_view path, std::string_view head) { return path.substr(head.size()); };
  const auto as_png = [](std::string_view path) {
    return std::string(path.substr(0, path.rfind('.'))) + ".png";
  };
  switch (plan.set) {
    case SetId::animal3d:
    case SetId::ctrlani3d:
      plan.listed = plan.image;
      plan.mask = fmt::format("{}/masks/{}", folder, as_png(without(plan.image, "images/")));
      break;
    case SetId::superanimal:
      plan.listed = plan.image;
      plan.image = "images/" + plan.listed.substr(plan.listed.rfind('/') + 1);  // npos + 1 == 0
      plan.mask = fmt::format("truth/masks/{}/{}", folder, as_png(without(plan.image, "images/")));
      break;
    case SetId::animal_kingdom:
      plan.listed = without(plan.image, "dataset/");
      plan.mask = fmt::format("truth/masks/{}/{}", folder, as_png(plan.listed));
      break;
  }
}

int scaled(int count, double share) {
  return count == 0 ? 0 : std::max(1, static_cast<int>(std::lround(count * share)));
}

}  // namespace

std::vector<int> share_out(int total, const std::vector<double>& weights) {
  const double sum = std::accumulate(weights.begin(), weights.end(), 0.0);
  if (!(sum > 0.0)) throw std::invalid_argument("share_out: the weights sum to " + std::to_string(sum));
  std::vector<int> counts(weights.size());
  std::vector<std::pair<double, std::size_t>> remainders;
  int left = total;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double exact = total * weights[i] / sum;
    counts[i] = static_cast<int>(exact);
    left -= counts[i];
    remainders.emplace_back(counts[i] - exact, i);  // most negative first
  }
  std::sort(remainders.begin(), remainders.end());
  for (int i = 0; i < left; ++i) ++counts[remainders[static_cast<std::size_t>(i)].second];
  return counts;
}

std::vector<PicturePlan> plan_split(SetId set, bool test, double share, std::uint64_t seed) {
  const Domain& domain = domain_of(set);
  const int total = scaled(test ? domain.test : domain.train, share);
  const int group = set == SetId::animal_kingdom ? kFramesPerFilm : 1;
  const int groups = (total + group - 1) / group;
  if (total == 0) return {};

  const auto species = species_table();
  std::vector<double> weights;
  for (const Species& row : species) weights.push_back(row.frequency.*domain.frequency);
  const std::vector<int> counts = share_out(groups, weights);
  std::vector<int> shown;  // species of each group
  for (std::size_t i = 0; i < counts.size(); ++i)
    shown.insert(shown.end(), static_cast<std::size_t>(counts[i]), static_cast<int>(i));
  const std::uint64_t split_key = 2 * static_cast<std::uint64_t>(set) + (test ? 1 : 0);
  manifests::Rng shuffle(seed, {split_key, order});
  for (int i = groups - 1; i > 0; --i) {
    std::swap(shown[static_cast<std::size_t>(i)], shown[static_cast<std::size_t>(shuffle.below(i + 1))]);
  }

  const int first_id = test ? scaled(domain.train, share) + 1 : 1;
  std::vector<PicturePlan> plans;
  for (int index = 0; index < total; ++index) {
    PicturePlan plan;
    plan.set = set;
    plan.test = test;
    plan.index = index;
    plan.individual = index / group;
    plan.species = shown[static_cast<std::size_t>(plan.individual)];
    plan.image_id = first_id + index;
    const Species& row = species[static_cast<std::size_t>(plan.species)];
    manifests::Rng rng(seed, {split_key, naming, static_cast<std::uint64_t>(index)});
    switch (set) {
      case SetId::animal3d:
        plan.image = animal3d_name(plan, row, rng);
        break;
      case SetId::ctrlani3d:
        plan.image = ctrlani3d_name(plan, row);
        break;
      case SetId::superanimal:
        plan.source = draw_source(row, rng);
        plan.image = source_file_name(plan.source, row, plan.image_id, rng);
        break;
      case SetId::animal_kingdom:
        plan.image = kingdom_name(plan, seed);
        break;
    }
    complete_paths(plan);
    plans.push_back(std::move(plan));
  }
  return plans;
}

}  // namespace q3d::pipeline::world
