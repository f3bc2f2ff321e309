// SPDX-License-Identifier: Apache-2.0
// Draws surfaces of triangles into a picture: each triangle is projected, and covers the pixels whose middles lie inside it.
#include <cmath>
#include <cstdint>

#include "picture.hpp"
#include "vector.hpp"

namespace mobee {

namespace painting {

// A corner of a triangle: its place right of, below and ahead of the camera, and its normal in the surface's own axes.
struct Corner {
    Vec3 at, normal;
};

// A corner in the picture.  `value`: what changes linearly over the picture, 1 / depth in a perspective one, else the depth.
struct Point {
    double column, row, value;
    Vec3 normal;
};

Corner between(const Corner& one, const Corner& other, double share) {
    return {one.at + share * (other.at - one.at), one.normal + share * (other.normal - one.normal)};
}

Point projected(const Picture& picture, const Corner& corner) {
    const double by = picture.perspective != 0 ? 1.0 / corner.at.z : 1.0;
    return {(corner.at.x * by - picture.left) / picture.step, (corner.at.y * by - picture.top) / picture.step,
            picture.perspective != 0 ? by : corner.at.z, corner.normal};
}

// Twice the area of the triangle of two points and the pixel (column, row), with a sign.
double side(const Point& one, const Point& other, double column, double row) {
    return (other.column - one.column) * (row - one.row) - (other.row - one.row) * (column - one.column);
}

void fill(const Picture& picture, const Surface& surface, const Point& a, const Point& b, const Point& c) {
    const double area = side(a, b, c.column, c.row);
    if (!(area != 0.0)) return;  // also not a number
    const double width = static_cast<double>(picture.width), height = static_cast<double>(picture.height);
    const double low_row = std::ceil(least(a.row, least(b.row, c.row))), high_row = std::floor(most(a.row, most(b.row, c.row)));
    const double low_column = std::ceil(least(a.column, least(b.column, c.column)));
    const double high_column = std::floor(most(a.column, most(b.column, c.column)));
    const auto first_row = static_cast<std::int64_t>(clamp(low_row, 0.0, height));
    const auto last_row = static_cast<std::int64_t>(clamp(high_row, -1.0, height - 1.0));
    const auto first_column = static_cast<std::int64_t>(clamp(low_column, 0.0, width));
    const auto last_column = static_cast<std::int64_t>(clamp(high_column, -1.0, width - 1.0));
    const double by = 1.0 / area;
    for (std::int64_t row = first_row; row <= last_row; ++row) {
        const double y = static_cast<double>(row);
        for (std::int64_t column = first_column; column <= last_column; ++column) {
            const double x = static_cast<double>(column);
            const double u = by * side(b, c, x, y), v = by * side(c, a, x, y), w = by * side(a, b, x, y);
            if (u < 0.0 || v < 0.0 || w < 0.0) continue;
            const double value = u * a.value + v * b.value + w * c.value;
            const float depth = static_cast<float>(picture.perspective != 0 ? 1.0 / value : value);
            const std::int64_t pixel = row * picture.width + column;
            if (!(depth < picture.depth[pixel])) continue;
            const Vec3 normal = u * a.normal + v * b.normal + w * c.normal;
            const double long_ = length(normal);
            const Vec3 outward = out_of(surface.rotation, (long_ > 0.0 ? 1.0 / long_ : 0.0) * normal);
            picture.depth[pixel] = depth;
            picture.which[pixel] = static_cast<std::int32_t>(surface.number);
            for (int k = 0; k < 3; ++k) picture.normal[3 * pixel + k] = static_cast<float>(outward[k]);
        }
    }
}

// The corners (at most 4) of the part of a triangle that is farther than `nearest`; returns their number.
int cut(const Corner* triangle, double nearest, Corner* kept) {
    int count = 0;
    for (int k = 0; k < 3; ++k) {
        const Corner &here = triangle[k], &next = triangle[(k + 1) % 3];
        const double before = here.at.z - nearest, after = next.at.z - nearest;
        if (before > 0.0) kept[count++] = here;
        if ((before > 0.0) != (after > 0.0)) kept[count++] = between(here, next, before / (before - after));
    }
    return count;
}

}  // namespace painting

void draw_surface(const Picture& picture, const Surface& surface) {
    using namespace painting;
    const Vec3 from = surface.center - picture.origin, middle = from + out_of(surface.rotation, surface.middle);
    const double far = dot(middle, picture.ahead);
    const Pixels columns = pixels_of(picture, dot(middle, picture.right), far, surface.bound, picture.left, picture.width);
    const Pixels rows = pixels_of(picture, dot(middle, picture.down), far, surface.bound, picture.top, picture.height);
    if (far + surface.bound <= picture.nearest || columns.begin >= columns.end || rows.begin >= rows.end) return;
    const Vec3 right = into(surface.rotation, picture.right), down = into(surface.rotation, picture.down);
    const Vec3 ahead = into(surface.rotation, picture.ahead);
    const Vec3 start{dot(from, picture.right), dot(from, picture.down), dot(from, picture.ahead)};
    for (std::int64_t number = 0; number < surface.count; ++number) {
        Corner triangle[3], kept[4];
        for (int k = 0; k < 3; ++k) {
            const std::int64_t corner = 3 * static_cast<std::int64_t>(surface.triangles[3 * number + k]);
            const float *p = surface.corners + corner, *n = surface.normals + corner;
            const Vec3 place{p[0], p[1], p[2]};
            triangle[k] = {{start.x + dot(right, place), start.y + dot(down, place), start.z + dot(ahead, place)}, {n[0], n[1], n[2]}};
        }
        // Normals point to the side from which the triangle is seen, whichever is its front in the file.
        const Vec3 face = cross(triangle[1].at - triangle[0].at, triangle[2].at - triangle[0].at);
        const Vec3 view = picture.perspective != 0 ? triangle[0].at : Vec3{0.0, 0.0, 1.0};
        const Vec3 mean = triangle[0].normal + triangle[1].normal + triangle[2].normal;
        const double facing = dot(face, view), along = face.x * dot(right, mean) + face.y * dot(down, mean) + face.z * dot(ahead, mean);
        if ((facing > 0.0) == (along > 0.0))
            for (Corner& corner : triangle) corner.normal = -corner.normal;
        const int count = cut(triangle, picture.nearest, kept);
        for (int k = 2; k < count; ++k)
            fill(picture, surface, projected(picture, kept[0]), projected(picture, kept[k - 1]), projected(picture, kept[k]));
    }
}

}  // namespace mobee
