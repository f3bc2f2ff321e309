// SPDX-License-Identifier: Apache-2.0
// Draws surfaces of triangles into a picture: each triangle is projected, and covers the pixels whose middles lie inside it.
#include <bit>
#include <cmath>
#include <cstdint>

#include "lanes.hpp"
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
template <class Number>
Number side(const Point& one, const Point& other, Number column, double row) {
    return (other.column - one.column) * (row - one.row) - (other.row - one.row) * (column - one.column);
}

// Whether the middle of a pixel may lie in a triangle, whose corners are the first three; many are smaller than a pixel.
bool covers(const Picture& picture, Four aside, Four below, Four away) {
    const Four by = picture.perspective != 0 ? 1.0 / away : Four{} + 1.0;
    const Four column = (aside * by - picture.left) / picture.step, row = (below * by - picture.top) / picture.step;
    const auto holds = [](Four at, std::int64_t size) {
        const double low = least(at[0], least(at[1], at[2])), high = most(at[0], most(at[1], at[2]));
        return most(std::ceil(low), 0.0) <= least(std::floor(high), static_cast<double>(size - 1));
    };
    return holds(row, picture.height) && holds(column, picture.width);
}

// Reduce a range of columns of a row to those on the inner side of an edge, and one more at each end: rounding may not drop a pixel.
void limit(const Point& one, const Point& other, double by, double row, double& low, double& high) {
    const double across = by * (other.row - one.row);
    if (across == 0.0) return;
    const double crossing = one.column + (other.column - one.column) * (row - one.row) / (other.row - one.row);
    if (across > 0.0) high = least(std::floor(crossing) + 1.0, high);
    if (across < 0.0) low = most(std::ceil(crossing) - 1.0, low);
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
        double low = static_cast<double>(first_column), high = static_cast<double>(last_column);
        limit(b, c, by, y, low, high);
        limit(c, a, by, y, low, high);
        limit(a, b, by, y, low, high);
        if (!(low <= high)) continue;
        const std::int64_t end = picture.ray_at(row, static_cast<std::int64_t>(high) + 1);
        for (std::int64_t ray = picture.ray_at(row, static_cast<std::int64_t>(low)); ray < end; ray += 4) {
            const Four x = picture.columns_of(ray, row);
            const Four u = by * side(b, c, x, y), v = by * side(c, a, x, y), w = by * side(a, b, x, y);
            const Four value = u * a.value + v * b.value + w * c.value;
            const Four depth = picture.perspective != 0 ? 1.0 / value : value;
            unsigned hit = ~(less(u, Four{}) | less(v, Four{}) | less(w, Four{})) & 15U;
            if (ray + 4 > end) hit &= (1U << (end - ray)) - 1U;
            for (unsigned rest = hit; rest != 0; rest &= rest - 1) {
                const int k = std::countr_zero(rest);
                if (!(static_cast<float>(depth[k]) < picture.depth[ray + k])) hit &= ~(1U << k);
            }
            if (hit == 0) continue;
            const Four right = u * a.normal.x + v * b.normal.x + w * c.normal.x, down = u * a.normal.y + v * b.normal.y + w * c.normal.y;
            const Four ahead = u * a.normal.z + v * b.normal.z + w * c.normal.z;
            const Four long_ = root_of(right * right + down * down + ahead * ahead), shorter = long_ > 0.0 ? 1.0 / long_ : Four{};
            for (; hit != 0; hit &= hit - 1) {
                const int k = std::countr_zero(hit);
                const Vec3 outward = out_of(surface.rotation, {shorter[k] * right[k], shorter[k] * down[k], shorter[k] * ahead[k]});
                picture.set(ray + k, static_cast<float>(depth[k]), static_cast<std::int32_t>(surface.number), outward);
            }
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
        const std::int32_t* corners = surface.triangles + 3 * number;
        const float *a = surface.corners + 3 * corners[0], *b = surface.corners + 3 * corners[1], *c = surface.corners + 3 * corners[2];
        const Four x{a[0], b[0], c[0], c[0]}, y{a[1], b[1], c[1], c[1]}, z{a[2], b[2], c[2], c[2]};
        const Four aside = start.x + (right.x * x + right.y * y + right.z * z), below = start.y + (down.x * x + down.y * y + down.z * z);
        const Four away = start.z + (ahead.x * x + ahead.y * y + ahead.z * z);
        if (less(Four{} + picture.nearest, away) == 15U && !covers(picture, aside, below, away)) continue;
        Corner triangle[3], kept[4];
        for (int k = 0; k < 3; ++k) {
            const float* n = surface.normals + 3 * corners[k];
            triangle[k] = {{aside[k], below[k], away[k]}, {n[0], n[1], n[2]}};
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
