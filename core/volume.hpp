// SPDX-License-Identifier: Apache-2.0
// A volume of the robot or of the world, placed in the root frame.
#pragma once

#include <cstdint>

#include "vector.hpp"

namespace mobee {

enum class Kind : std::int32_t { sphere, capsule, cylinder, box, convex };

// The corners of a convex hull, in its own axes [m], and its edges: the neighbours of corner i are
// edges[starts[i]] .. edges[starts[i + 1] - 1].  Without edges (nullptr), a search tests all corners.
struct Hull {
    const Vec3* corners = nullptr;
    std::int32_t count = 0;
    const std::int32_t* starts = nullptr;
    const std::int32_t* edges = nullptr;
};

struct Volume {
    Vec3 center;
    Rotation rotation;
    Vec3 half;              // sphere (r, 0, 0); capsule and cylinder (r, half height, 0); box half edges
    Vec3 core;              // half of the axis of a capsule or cylinder, 0 for others
    double radius = 0.0;    // about the core; 0 for boxes and hulls
    double bound = 0.0;     // radius of the sphere about the centre that contains the volume
    double squared = 0.0;   // of the core's length
    double inverse = 0.0;   // one over it, 0 without a core
    Kind kind = Kind::sphere;
    Hull hull;              // of convex volumes
};

// The contact of two volumes, root frame: moving the first by depth * normal separates them; the point is midway between the deepest points.
struct Touch {
    Vec3 normal, point;
};

// Return the depth by which two volumes overlap [m]; if they do not, minus a lower bound of their distance, and `touch` is not changed.
double overlap(const Volume& a, const Volume& b, Touch& touch);

// Return the distance of two volumes [m], 0 if they overlap.
double distance(const Volume& a, const Volume& b);

}  // namespace mobee
