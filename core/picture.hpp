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
//
// The rays are those of all pixels, or of some.  They are numbered row by row.
struct Picture {
    const Convex* volumes;
    const Surface* surfaces;
    float* depth;         // (rays,), filled: along ahead [m], infinite where there is nothing
    std::int32_t* which;  // (rays,), filled: the number of the volume, -1 where there is nothing
    float* normal;        // (rays, 3), filled: outward, root frame, 0 where there is nothing
    const std::int32_t* before;   // (height, width + 1): number of rays before each pixel and each end of a row; null: each pixel has a ray
    const std::int32_t* columns;  // (rays + 3,): of each ray; the last three are read, but not used
    std::int64_t rays, count, surface_count, height, width, perspective;
    Vec3 origin, right, down, ahead;
    double left, top, step;
    double nearest;       // a surface nearer than this is not drawn [m]

    // The number of the first ray of a row at or right of a column, 0 <= column <= width.
    std::int64_t ray_at(std::int64_t row, std::int64_t column) const {
        return before != nullptr ? before[row * (width + 1) + column] : row * width + column;
    }

    std::int64_t column_of(std::int64_t ray, std::int64_t row) const { return columns != nullptr ? columns[ray] : ray - row * width; }

    // The columns of four successive rays of a row.
    Four columns_of(std::int64_t ray, std::int64_t row) const {
        if (columns == nullptr) return Four{0.0, 1.0, 2.0, 3.0} + static_cast<double>(ray - row * width);
        return Four{static_cast<double>(columns[ray]), static_cast<double>(columns[ray + 1]), static_cast<double>(columns[ray + 2]),
                    static_cast<double>(columns[ray + 3])};
    }

    // Write what a ray meets.
    void set(std::int64_t ray, float at, std::int32_t number, Vec3 outward) const {
        depth[ray] = at;
        which[ray] = number;
        normal[3 * ray] = static_cast<float>(outward.x);
        normal[3 * ray + 1] = static_cast<float>(outward.y);
        normal[3 * ray + 2] = static_cast<float>(outward.z);
    }
};

// A lamp far away, and pixels whose brightness is increased by that of what a ray of each meets.
struct Light {
    const std::int32_t* which;  // (rays,), as of a Picture
    const float* normal;        // (rays, 3)
    const std::int64_t* rays;   // (count,): that of each pixel
    const float* colors;        // (numbers, 3), 0 to 255
    float* brightness;          // (count, 3), added to
    std::int64_t count;
    double towards[3];          // unit vector towards the lamp, root frame
    float nothing[3];           // the brightness of a pixel that shows nothing
    float ambient, diffuse;     // brightness of a surface that is turned away from the lamp, and how much brighter one is that faces it
};

struct Pixels {
    std::int64_t begin, end;
};

// The range of pixels along one axis of the picture in which a sphere can be visible; `aside`, `ahead`: its centre from the origin (rays.cpp).
Pixels pixels_of(const Picture& picture, double aside, double ahead, double radius, double first, std::int64_t size);

// Draw a surface over what the picture holds already, where it is nearer (triangles.cpp).
void draw_surface(const Picture& picture, const Surface& surface);

}  // namespace mobee
