#include "pipeline/world/picture.h"

#include <oneapi/tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

#include "pipeline/world/animal_layer.h"
#include "pipeline/world/foreground.h"
#include "pipeline/world/lens.h"

namespace q3d::pipeline::world {
namespace {

enum Purpose : std::uint64_t {
  individual = 11,
  moment,
  size,
  framing,
  light,
  surroundings,
  occluders,
  lens,
  labels
};

constexpr double kLeastVisible = 0.45;  // share of the animal that occluders may not hide

Light draw_light(const Domain& domain, const Ground& ground, const Backdrop& backdrop, manifests::Rng& rng) {
  Light light;
  const bool sunny = rng.chance(domain.sunny) && backdrop.place != Place::room;
  const double high = rng.uniform(22.0, 75.0) * std::numbers::pi / 180.0;
  const double around = rng.uniform(0.0, 2.0 * std::numbers::pi);
  // The sun is mostly on the photographer's side of the animal.
  Eigen::Vector3f level(static_cast<float>(std::cos(around)), 0.0F, static_cast<float>(std::sin(around)));
  if (level.z() > 0.0F && rng.chance(0.7)) level.z() = -level.z();
  const Eigen::Vector3f along = (level - level.dot(ground.up) * ground.up).normalized();
  light.to_sun = static_cast<float>(std::cos(high)) * along + static_cast<float>(std::sin(high)) * ground.up;

  const float low = high < 0.6 ? 1.0F : 0.0F;  // a low sun is yellow
  const auto strength = static_cast<float>(sunny ? rng.uniform(0.75, 1.15) : rng.uniform(0.1, 0.3));
  const auto ambient = static_cast<float>(sunny ? rng.uniform(0.3, 0.5) : rng.uniform(0.55, 0.85));
  light.sun = strength * Colour(1.0F, 0.95F - 0.08F * low, 0.86F - 0.2F * low);
  light.sky = ambient * (sunny ? Colour(0.92F, 1.0F, 1.1F) : Colour(1.0F, 1.0F, 1.0F));
  const Colour ground_colour = 0.5F * (backdrop.ground_dark + backdrop.ground_light);
  light.bounce = ambient * 0.25F + 0.45F * (ambient + 0.5F * strength) * ground_colour * ground_colour;
  light.ground_shadow = 1.0F - std::sqrt(ambient / (ambient + strength));  // screen values are roots of light
  return light;
}

// Puts something in front of the animal, unless it would hide too much of it.
void occlude(cv::Mat& picture, cv::Mat1b& cover, const cv::Mat1b& silhouette, const Backdrop& backdrop,
             manifests::Rng& rng) {
  const cv::Rect animal = cv::boundingRect(silhouette);
  const int count = 1 + (rng.chance(0.25) ? 1 : 0);
  for (int i = 0; i < count; ++i) {
    cv::Mat changed = picture.clone();
    cv::Mat1b hidden = cover.clone();
    paint_occluder(changed, hidden, animal, backdrop, rng);
    const int left = cv::countNonZero(silhouette & ~hidden);
    if (left < kLeastVisible * cv::countNonZero(silhouette)) continue;
    picture = changed;
    cover = hidden;
  }
}

bool covered_at(const cv::Mat1b& cover, const Eigen::Vector2d& px) {
  const cv::Point at(static_cast<int>(std::lround(px.x())), static_cast<int>(std::lround(px.y())));
  return cv::Rect({0, 0}, cover.size()).contains(at) && cover(at) != 0;
}

std::vector<SeenLandmark> look(const std::vector<Landmark>& landmarks,
                               const std::vector<Eigen::Vector3f>& points, const AnimalLayer& animal,
                               const PictureCamera& camera, const cv::Mat1b& cover) {
  std::vector<float> tolerance;
  for (const Landmark& landmark : landmarks) tolerance.push_back(landmark.depth);
  const std::vector<std::uint8_t> hidden = animal.hidden(points, tolerance);
  std::vector<SeenLandmark> seen(landmarks.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!landmarks[i].exists()) continue;
    seen[i].exists = true;
    seen[i].px = camera.project(points[i]);
    seen[i].inside = seen[i].px.x() >= 0.0 && seen[i].px.y() >= 0.0 && seen[i].px.x() <= cover.cols - 1.0 &&
                     seen[i].px.y() <= cover.rows - 1.0;
    seen[i].self_hidden = hidden[i] != 0;
    seen[i].occluded = covered_at(cover, seen[i].px);
  }
  return seen;
}

std::vector<Eigen::Vector3f> placed(const std::vector<Landmark>& landmarks, const Body& body,
                                    const Eigen::Vector3f& translation) {
  std::vector<Eigen::Vector3f> points = landmark_points(landmarks, body);
  for (Eigen::Vector3f& point : points) point += translation;
  return points;
}

}  // namespace

PictureRenderer::PictureRenderer(std::uint64_t seed, int picture_px)
    : seed_(seed),
      picture_px_(picture_px),
      noise_(seed),
      painter_(model_.rest(), noise_),
      landmarks_{animal3d_landmarks(model_.rest()), animal3d_landmarks(model_.rest()),
                 superanimal_landmarks(model_.rest()), animal_kingdom_landmarks(model_.rest())} {}

manifests::Rng PictureRenderer::stream(const PicturePlan& plan, std::uint64_t purpose) const {
  const int number = purpose == individual ? plan.individual : plan.index;
  return manifests::Rng(seed_, {static_cast<std::uint64_t>(plan.set), plan.test ? 1ULL : 0ULL, purpose,
                                static_cast<std::uint64_t>(number)});
}

std::vector<Picture> PictureRenderer::render(std::span<const PicturePlan> plans) const {
  std::vector<Subject> subjects;
  std::vector<Posture> postures;
  for (const PicturePlan& plan : plans) {
    manifests::Rng who = stream(plan, individual), when = stream(plan, moment);
    subjects.push_back(draw_subject(species_table()[static_cast<std::size_t>(plan.species)],
                                    domain_of(plan.set), model_.shapes(), who, when));
    postures.push_back(subjects.back().posture);
  }
  const std::vector<Body> bodies = model_.pose(postures);
  std::vector<Picture> pictures(plans.size());
  tbb::parallel_for(std::size_t{0}, plans.size(),
                    [&](std::size_t i) { pictures[i] = render_one(plans[i], subjects[i], bodies[i]); });
  return pictures;
}

Picture PictureRenderer::render_one(const PicturePlan& plan, const Subject& subject, const Body& body) const {
  const Domain& domain = domain_of(plan.set);
  manifests::Rng rng = stream(plan, size);
  const cv::Size2d units =
      domain.sizes[static_cast<std::size_t>(rng.below(static_cast<int>(domain.sizes.size())))];
  Picture result;
  PictureTruth& truth = result.truth;
  truth.size_px = cv::Size(static_cast<int>(std::lround(units.width * picture_px_)),
                           static_cast<int>(std::lround(units.height * picture_px_)));
  truth.posture = subject.posture;
  truth.keypoints_3d = body.keypoints;
  rng = stream(plan, framing);
  truth.framing = frame_animal(body.vertices, truth.size_px, domain.framing, rng);
  const PictureCamera& camera = truth.framing.camera;

  const AnimalLayer animal(device_, model_.rest(), body, truth.framing.translation);
  Ground ground{subject.up, 0.0F};
  ground.level = -static_cast<float>(subject.lift);
  float lowest = std::numeric_limits<float>::infinity();
  for (const Eigen::Vector3f& vertex : animal.vertices()) lowest = std::min(lowest, subject.up.dot(vertex));
  ground.level += lowest;

  rng = stream(plan, surroundings);
  const Backdrop backdrop = draw_palette(subject.place, rng);
  cv::Mat picture =
      paint_backdrop(backdrop, truth.size_px, camera, ground, truth.framing.translation.z(), noise_, rng);
  manifests::Rng sun = stream(plan, light);
  const Light sunlight = draw_light(domain, ground, backdrop, sun);
  animal.cast_shadow(picture, camera, ground, sunlight);
  const cv::Mat1b silhouette =
      animal.paint(picture, camera, ground, sunlight, painter_, subject.coat, subject.individual);
  paint_grass_at_feet(picture, backdrop, camera, ground, animal.vertices(), rng);
  cv::Mat1b cover(truth.size_px, std::uint8_t{0});
  rng = stream(plan, occluders);
  if (rng.chance(domain.occluded)) occlude(picture, cover, silhouette, backdrop, rng);

  rng = stream(plan, lens);
  cover(expose(picture, domain.lens, rng)).setTo(255);
  result.jpeg = encode_jpeg(picture, domain.lens, rng);
  const cv::Mat1b visible = silhouette & ~cover;
  if (!cv::imencode(".png", visible, result.mask_png, {cv::IMWRITE_PNG_COMPRESSION, 1})) {
    throw std::runtime_error("world: cannot encode the mask of " + plan.image);
  }

  const auto& own = landmarks_[static_cast<std::size_t>(plan.set)];
  const auto& smal = landmarks_[static_cast<std::size_t>(SetId::animal3d)];
  const auto exact = look(smal, placed(smal, body, truth.framing.translation), animal, camera, cover);
  std::copy(exact.begin(), exact.end(), truth.keypoints.begin());
  const auto seen = look(own, placed(own, body, truth.framing.translation), animal, camera, cover);
  rng = stream(plan, labels);
  truth.labels =
      annotate(own, seen, std::max(truth.framing.box.width, truth.framing.box.height), domain.labels, rng);
  return result;
}

}  // namespace q3d::pipeline::world
