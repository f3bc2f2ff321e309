// SPDX-License-Identifier: Apache-2.0
// The arguments of a picture from Python, see mobee/_core/rays.py.
#pragma once

#include <cstdint>

#include "vector.hpp"

namespace mobee {

// One volume; `half` as in Volume.  A hull is the set of points x in its own axes with normal . x <= offset for each of its planes.
struct Convex {
    Vec3 center;
    Rotation rotation;
    Vec3 half;
    double bound;          // radius of the sphere about the centre that holds the volume
    std::int64_t kind;     // of enum Kind
    const double* planes;  // (count, 4): outward unit normal and offset, of hulls
    std::int64_t count;
};

// A surface of triangles, seen from both sides; positions and normals of its corners are in its own axes.
struct Surface {
    Vec3 center;
    Rotation rotation;
    Vec3 middle;                    // in its own axes
    double bound;                   // radius of the sphere about the middle that holds the surface
    const float* corners;           // (corners, 3) m
    const float* normals;           // (corners, 3)
    const std::int32_t* triangles;  // (count, 3): indices of corners
    std::int64_t count, number;     // of triangles; the number that is drawn into `which`
};

// The ray of column i and row j, with x = left + i * step and y = top + j * step:
// in a perspective picture from `origin` along ahead + x * right + y * down, in a parallel one from origin + x * right + y * down along ahead.
struct Picture {
    const Convex* volumes;
    const Surface* surfaces;
    float* depth;         // (height, width), filled: along ahead [m], infinite where there is nothing
    std::int32_t* which;  // (height, width), filled: the number of the volume, -1 where there is nothing
    float* normal;        // (height, width, 3), filled: outward, root frame, 0 where there is nothing
    std::int64_t count, surface_count, height, width, perspective;
    Vec3 origin, right, down, ahead;
    double left, top, step;
    double nearest;       // a surface nearer than this is not drawn [m]
};

struct Pixels {
    std::int64_t begin, end;
};

// The range of pixels along one axis of the picture in which a sphere can be visible; `aside`, `ahead`: its centre from the origin (rays.cpp).
Pixels pixels_of(const Picture& picture, double aside, double ahead, double radius, double first, std::int64_t size);

// Draw a surface over what the picture holds already, where it is nearer (triangles.cpp).
void draw_surface(const Picture& picture, const Surface& surface);

}  // namespace mobee
