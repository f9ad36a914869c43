// The topology of the synthetic quadruped's mesh: its vertices and faces, which are the same for every shape.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

namespace q3d::pipeline::animal {

// The body is one tube of rings from the rump to the nose; legs, tail, ears and jaw are tubes that grow out
// of rectangular holes in it. Every tube ends in a pole. Rings are closed, so the whole surface is closed.
enum class Part {
  body,
  right_foreleg,
  left_foreleg,
  right_hindleg,
  left_hindleg,
  tail,
  jaw,
  right_ear,
  left_ear
};
inline constexpr std::size_t kNumParts = 9;

inline constexpr int kBodyRings = 56;
inline constexpr int kBodySides =
    32;  // vertices of a body ring: 0 on the back, 8 on the right, 16 on the belly

// A rectangle of the body's grid, rings [first_ring, last_ring] and sides [first_side, last_side], that a
// tube replaces. Sides may be negative: left of the back.
struct Hole {
  int first_ring, last_ring;
  int first_side, last_side;
  int length() const { return last_ring - first_ring; }
  int width() const { return last_side - first_side; }
  int border() const { return 2 * (length() + width()); }
};

// A tube's ring has as many vertices as its hole's border. Vertex 0 continues the border's corner
// (first_ring, first_side); then come first_side forwards, last_ring downwards, last_side backwards,
// first_ring upwards.
struct Tube {
  Part part;
  Hole hole;
  int rings;
};

// The tubes on the right and in the middle. The left ones are mirror images.
inline constexpr std::array<Tube, 5> kTubes = {{
    {Part::right_foreleg, {26, 31, 9, 14}, 19},
    {Part::right_hindleg, {2, 9, 8, 13}, 19},
    {Part::tail, {1, 3, -2, 2}, 19},
    {Part::jaw, {45, 48, 13, 19}, 8},
    {Part::right_ear, {43, 46, 2, 5}, 6},
}};

struct MeshVertex {
  Part part;
  int ring;  // -1 and the number of rings stand for poles
  int side;  // 0 for poles
};

struct QuadrupedMesh {
  std::vector<MeshVertex> vertices;
  std::vector<std::array<int, 3>> faces;  // counter-clockwise from outside
  std::vector<int> mirror;                // the vertex on the other side; itself on the middle
  std::vector<int> half;                  // 1 right, 0 on the middle, -1 left
  std::array<std::vector<std::vector<int>>, kNumParts> rings;  // [part][ring][side], -1 inside a hole
  std::array<int, kNumParts> end_pole;                         // nose, toes, tips
  int rear_pole;                                               // of the body
  std::vector<std::vector<int>> neighbours;                    // ascending

  const std::vector<std::vector<int>>& rings_of(Part part) const {
    return rings[static_cast<std::size_t>(part)];
  }
  // Returns the vertex of a ring's side, which may be counted in either direction. Returns -1 inside a hole.
  int body_vertex(int ring, int side) const {
    return rings_of(Part::body)[static_cast<std::size_t>(ring)]
                               [static_cast<std::size_t>((side + kBodySides) % kBodySides)];
  }
  int pole_of(Part part) const { return end_pole[static_cast<std::size_t>(part)]; }
};

// Returns the mesh. It has 3889 vertices and 7774 faces, is closed, of genus 0, and symmetric.
QuadrupedMesh make_quadruped_mesh();

// Returns the part on the other side. A part in the middle is its own mirror image.
Part mirror_part(Part part);

// Returns the border of a hole as (ring, side) pairs of the body, in the order of the tube's ring; the second
// function returns its vertices.
std::vector<std::array<int, 2>> hole_border(const Hole& hole);
std::vector<int> border_vertices(const QuadrupedMesh& mesh, const Hole& hole);

// Returns the tube of a part, or of its mirror image. The body has no tube.
const Tube& tube_of(Part part);

}  // namespace q3d::pipeline::animal
