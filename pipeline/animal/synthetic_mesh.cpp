#include "pipeline/animal/synthetic_mesh.h"

#include <algorithm>
#include <set>
#include <stdexcept>

namespace q3d::pipeline::animal {
namespace {

std::size_t number(Part part) {
  return static_cast<std::size_t>(part);
}

int wrapped_side(int side) {
  return (side + kBodySides) % kBodySides;
}

bool is_middle(Part part) {
  return mirror_part(part) == part;
}

class MeshBuilder {
 public:
  QuadrupedMesh build() {
    add_body();
    for (const Tube& tube : kTubes) {
      add_tube(tube, false);
      if (!is_middle(tube.part)) add_tube(tube, true);
    }
    pair_body();
    for (const Tube& tube : kTubes) pair_tube(tube);
    for (std::size_t v = 0; v < mesh_.vertices.size(); ++v)
      mesh_.half.push_back(half_of(static_cast<int>(v)));
    join_body();
    for (const Tube& tube : kTubes) join_tube(tube);
    mirror_faces();
    find_neighbours();
    return std::move(mesh_);
  }

 private:
  int add(Part part, int ring, int side) {
    mesh_.vertices.push_back({part, ring, side});
    return static_cast<int>(mesh_.vertices.size()) - 1;
  }

  static bool inside_hole(int ring, int side) {
    const auto inside = [ring](const Hole& hole, int at) {
      return hole.first_ring < ring && ring < hole.last_ring && hole.first_side < at && at < hole.last_side;
    };
    return std::any_of(kTubes.begin(), kTubes.end(), [&](const Tube& tube) {
      // A side may be counted to the right of the back, to the left as a negative number, or in the mirror
      // image.
      return inside(tube.hole, side) || inside(tube.hole, side - kBodySides) || inside(tube.hole, -side) ||
             inside(tube.hole, kBodySides - side);
    });
  }

  void add_body() {
    auto& rings = mesh_.rings[number(Part::body)];
    mesh_.rear_pole = add(Part::body, -1, 0);
    for (int ring = 0; ring < kBodyRings; ++ring) {
      auto& row = rings.emplace_back();
      for (int side = 0; side < kBodySides; ++side) {
        row.push_back(inside_hole(ring, side) ? -1 : add(Part::body, ring, side));
      }
    }
    mesh_.end_pole[number(Part::body)] = add(Part::body, kBodyRings, 0);
  }

  void add_tube(const Tube& tube, bool left) {
    const Part part = left ? mirror_part(tube.part) : tube.part;
    for (int ring = 0; ring < tube.rings; ++ring) {
      auto& row = mesh_.rings[number(part)].emplace_back();
      for (int side = 0; side < tube.hole.border(); ++side) row.push_back(add(part, ring, side));
    }
    mesh_.end_pole[number(part)] = add(part, tube.rings, 0);
  }

  void pair(int right, int left) {
    mesh_.mirror.resize(mesh_.vertices.size(), -1);
    mesh_.mirror[static_cast<std::size_t>(right)] = left;
    mesh_.mirror[static_cast<std::size_t>(left)] = right;
  }

  void pair_body() {
    pair(mesh_.rear_pole, mesh_.rear_pole);
    pair(mesh_.pole_of(Part::body), mesh_.pole_of(Part::body));
    for (const auto& row : mesh_.rings_of(Part::body)) {
      for (int side = 0; side < kBodySides; ++side) {
        const int right = row[static_cast<std::size_t>(side)];
        if (right >= 0) pair(right, row[static_cast<std::size_t>(wrapped_side(-side))]);
      }
    }
  }

  void pair_tube(const Tube& tube) {
    const Part left = mirror_part(tube.part);
    pair(mesh_.pole_of(tube.part), mesh_.pole_of(left));
    const auto border = hole_border(tube.hole);
    for (std::size_t ring = 0; ring < mesh_.rings_of(tube.part).size(); ++ring) {
      for (std::size_t side = 0; side < border.size(); ++side) {
        std::size_t other = side;
        if (is_middle(tube.part)) {
          const std::array<int, 2> image = {border[side][0], wrapped_side(-border[side][1])};
          other = static_cast<std::size_t>(std::find_if(border.begin(), border.end(),
                                                        [&](const auto& at) {
                                                          return at[0] == image[0] &&
                                                                 wrapped_side(at[1]) == image[1];
                                                        }) -
                                           border.begin());
        }
        pair(mesh_.rings_of(tube.part)[ring][side], mesh_.rings_of(left)[ring][other]);
      }
    }
  }

  // Returns 1 for a vertex on the right, 0 in the middle and -1 on the left.
  int half_of(int vertex) const {
    const auto v = static_cast<std::size_t>(vertex);
    if (mesh_.mirror[v] == vertex) return 0;
    const MeshVertex& at = mesh_.vertices[v];
    if (!is_middle(at.part)) return at.part < mirror_part(at.part) ? 1 : -1;
    int side = at.side;
    if (at.part != Part::body) {
      side = wrapped_side(hole_border(tube_of(at.part).hole)[static_cast<std::size_t>(at.side)][1]);
    }
    return side < kBodySides / 2 ? 1 : -1;
  }

  // Adds a face of the right half; mirror_faces makes the other half.
  void add_face(int a, int b, int c) {
    const auto on_right = [this](int vertex) { return mesh_.half[static_cast<std::size_t>(vertex)] >= 0; };
    if (on_right(a) && on_right(b) && on_right(c)) mesh_.faces.push_back({a, b, c});
  }

  void add_quad(int a, int b, int c, int d) {
    add_face(a, b, c);
    add_face(a, c, d);
  }

  void join_body() {
    const auto& rings = mesh_.rings_of(Part::body);
    for (std::size_t side = 0; side < kBodySides / 2; ++side) {
      const std::size_t next = side + 1;
      add_face(mesh_.rear_pole, rings.front()[next], rings.front()[side]);
      add_face(mesh_.pole_of(Part::body), rings.back()[side], rings.back()[next]);
      for (std::size_t ring = 0; ring + 1 < rings.size(); ++ring) {
        if (covered(static_cast<int>(ring), static_cast<int>(side))) continue;
        add_quad(rings[ring][side], rings[ring][next], rings[ring + 1][next], rings[ring + 1][side]);
      }
    }
  }

  // Returns whether the quad that starts at (ring, side) of the right half is part of a hole.
  static bool covered(int ring, int side) {
    return std::any_of(kTubes.begin(), kTubes.end(), [&](const Tube& tube) {
      const Hole& hole = tube.hole;
      return hole.first_ring <= ring && ring < hole.last_ring && hole.first_side <= side &&
             side < hole.last_side;
    });
  }

  void join_tube(const Tube& tube) {
    std::vector<int> above = border_vertices(mesh_, tube.hole);
    for (const auto& row : mesh_.rings_of(tube.part)) {
      for (std::size_t side = 0; side < row.size(); ++side) {
        const std::size_t next = (side + 1) % row.size();
        add_quad(above[side], row[side], row[next], above[next]);
      }
      above = row;
    }
    for (std::size_t side = 0; side < above.size(); ++side) {
      add_face(mesh_.pole_of(tube.part), above[(side + 1) % above.size()], above[side]);
    }
  }

  void mirror_faces() {
    const auto image = [this](int vertex) { return mesh_.mirror[static_cast<std::size_t>(vertex)]; };
    const std::size_t right = mesh_.faces.size();
    for (std::size_t f = 0; f < right; ++f) {
      const auto [a, b, c] = mesh_.faces[f];
      mesh_.faces.push_back({image(a), image(c), image(b)});
    }
  }

  void find_neighbours() {
    std::vector<std::set<int>> sets(mesh_.vertices.size());
    for (const auto& face : mesh_.faces) {
      for (std::size_t corner = 0; corner < 3; ++corner) {
        sets[static_cast<std::size_t>(face[corner])].insert(face[(corner + 1) % 3]);
        sets[static_cast<std::size_t>(face[corner])].insert(face[(corner + 2) % 3]);
      }
    }
    for (const auto& set : sets) mesh_.neighbours.emplace_back(set.begin(), set.end());
  }

  QuadrupedMesh mesh_;
};

}  // namespace

QuadrupedMesh make_quadruped_mesh() {
  return MeshBuilder().build();
}

Part mirror_part(Part part) {
  switch (part) {
    case Part::right_foreleg:
      return Part::left_foreleg;
    case Part::left_foreleg:
      return Part::right_foreleg;
    case Part::right_hindleg:
      return Part::left_hindleg;
    case Part::left_hindleg:
      return Part::right_hindleg;
    case Part::right_ear:
      return Part::left_ear;
    case Part::left_ear:
      return Part::right_ear;
    default:
      return part;
  }
}

std::vector<std::array<int, 2>> hole_border(const Hole& hole) {
  std::vector<std::array<int, 2>> border;
  for (int ring = hole.first_ring; ring < hole.last_ring; ++ring) border.push_back({ring, hole.first_side});
  for (int side = hole.first_side; side < hole.last_side; ++side) border.push_back({hole.last_ring, side});
  for (int ring = hole.last_ring; ring > hole.first_ring; --ring) border.push_back({ring, hole.last_side});
  for (int side = hole.last_side; side > hole.first_side; --side) border.push_back({hole.first_ring, side});
  return border;
}

std::vector<int> border_vertices(const QuadrupedMesh& mesh, const Hole& hole) {
  std::vector<int> vertices;
  for (const auto& [ring, side] : hole_border(hole)) vertices.push_back(mesh.body_vertex(ring, side));
  return vertices;
}

const Tube& tube_of(Part part) {
  for (const Tube& tube : kTubes) {
    if (tube.part == part || mirror_part(tube.part) == part) return tube;
  }
  throw std::invalid_argument("tube_of: the body is not a tube");
}

}  // namespace q3d::pipeline::animal
