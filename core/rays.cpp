// SPDX-License-Identifier: Apache-2.0
// Pictures of convex volumes and of surfaces: a ray through the middle of each pixel, and the volume that it enters first.
#include <cmath>
#include <cstdint>
#include <limits>

#include "interface.hpp"
#include "picture.hpp"
#include "vector.hpp"
#include "volume.hpp"

namespace mobee {

// The range of pixels along one axis of the picture in which a sphere can be visible; `aside`, `ahead`: its centre from the origin.
Pixels pixels_of(const Picture& picture, double aside, double ahead, double radius, double first, std::int64_t size) {
    double low = aside - radius, high = aside + radius;
    if (picture.perspective != 0) {
        const double distance = std::hypot(aside, ahead);
        if (distance <= radius) return {0, size};
        const double middle = std::atan2(aside, ahead), half = std::asin(radius / distance);
        constexpr double quarter = 1.5707963267948966;
        if (middle - half >= quarter || middle + half <= -quarter) return {0, 0};
        low = middle - half <= -quarter ? -std::numeric_limits<double>::infinity() : std::tan(middle - half);
        high = middle + half >= quarter ? std::numeric_limits<double>::infinity() : std::tan(middle + half);
    }
    const double last = static_cast<double>(size);
    const double begin = std::floor((low - first) / picture.step), end = std::ceil((high - first) / picture.step) + 1.0;
    return {static_cast<std::int64_t>(clamp(begin, 0.0, last)), static_cast<std::int64_t>(clamp(end, 0.0, last))};
}

namespace casting {

constexpr double infinity = std::numeric_limits<double>::infinity();

// The point where a ray enters a volume, in the volume's own axes.
struct Entry {
    double at = infinity;
    Vec3 normal;
};

// The part of a ray inside all planes so far.
struct Inside {
    double enter = -infinity, leave = infinity;
    Vec3 normal;

    // Keep the part behind the plane normal . x = offset.
    void cut(Vec3 outward, double offset, Vec3 start, Vec3 along) {
        const double before = offset - dot(outward, start), slope = dot(outward, along);
        if (slope == 0.0) {
            if (before < 0.0) leave = -infinity;
        } else if (slope < 0.0) {
            const double at = before / slope;
            if (at > enter) {
                enter = at;
                normal = outward;
            }
        } else {
            leave = least(leave, before / slope);
        }
    }
};

Entry into_sphere(Vec3 start, Vec3 along, double radius, double z) {
    const Vec3 from{start.x, start.y, start.z - z};
    const double a = dot(along, along), b = dot(from, along), left = b * b - a * (dot(from, from) - radius * radius);
    if (left < 0.0) return {};
    const double at = (-b - std::sqrt(left)) / a;
    return {at, (1.0 / radius) * (from + at * along)};
}

// The part of a ray inside the infinite cylinder about z; enter > leave if it misses.
Inside within_mantle(Vec3 start, Vec3 along, double radius) {
    Inside found;
    const double a = along.x * along.x + along.y * along.y, c = start.x * start.x + start.y * start.y - radius * radius;
    if (a == 0.0) {
        if (c > 0.0) found.leave = -infinity;
        return found;
    }
    const double b = start.x * along.x + start.y * along.y, left = b * b - a * c;
    if (left < 0.0) {
        found.leave = -infinity;
        return found;
    }
    const double root = std::sqrt(left);
    found.enter = (-b - root) / a;
    found.leave = (-b + root) / a;
    found.normal = {(start.x + found.enter * along.x) / radius, (start.y + found.enter * along.y) / radius, 0.0};
    return found;
}

Entry entry_of(const Inside& inside) {
    if (inside.enter > inside.leave) return {};
    return {inside.enter, inside.normal};
}

Entry into_cylinder(Vec3 start, Vec3 along, double radius, double half_height) {
    Inside inside = within_mantle(start, along, radius);
    inside.cut({0.0, 0.0, 1.0}, half_height, start, along);
    inside.cut({0.0, 0.0, -1.0}, half_height, start, along);
    return entry_of(inside);
}

Entry into_capsule(Vec3 start, Vec3 along, double radius, double half_height) {
    const Inside mantle = within_mantle(start, along, radius);
    Entry found;
    if (mantle.enter <= mantle.leave && std::isfinite(mantle.enter) && std::abs(start.z + mantle.enter * along.z) <= half_height)
        found = {mantle.enter, mantle.normal};
    for (const double z : {half_height, -half_height}) {
        const Entry cap = into_sphere(start, along, radius, z);
        if (cap.at < found.at) found = cap;
    }
    return found;
}

Entry into_box(Vec3 start, Vec3 along, Vec3 half) {
    Inside inside;
    for (int k = 0; k < 3; ++k) {
        Vec3 normal;
        for (const double side : {1.0, -1.0}) {
            normal[k] = side;
            inside.cut(normal, half[k], start, along);
        }
    }
    return entry_of(inside);
}

Entry into_hull(Vec3 start, Vec3 along, const double* planes, std::int64_t count) {
    Inside inside;
    for (std::int64_t k = 0; k < count && inside.enter <= inside.leave; ++k, planes += 4)
        inside.cut({planes[0], planes[1], planes[2]}, planes[3], start, along);
    return entry_of(inside);
}

Entry enter(const Convex& volume, Vec3 start, Vec3 along) {
    switch (static_cast<Kind>(volume.kind)) {
        case Kind::sphere: return into_sphere(start, along, volume.half.x, 0.0);
        case Kind::capsule: return into_capsule(start, along, volume.half.x, volume.half.y);
        case Kind::cylinder: return into_cylinder(start, along, volume.half.x, volume.half.y);
        case Kind::box: return into_box(start, along, volume.half);
        case Kind::convex: return into_hull(start, along, volume.planes, volume.count);
    }
    return {};
}

void draw(const Picture& picture, std::int32_t number) {
    const Convex& volume = picture.volumes[number];
    const Vec3 from = volume.center - picture.origin;
    const double ahead = dot(from, picture.ahead);
    if (ahead + volume.bound <= picture.nearest) return;
    const Pixels columns = pixels_of(picture, dot(from, picture.right), ahead, volume.bound, picture.left, picture.width);
    const Pixels rows = pixels_of(picture, dot(from, picture.down), ahead, volume.bound, picture.top, picture.height);
    const Vec3 start = into(volume.rotation, -from), forward = into(volume.rotation, picture.ahead);
    const Vec3 right = into(volume.rotation, picture.right), down = into(volume.rotation, picture.down);
    for (std::int64_t row = rows.begin; row < rows.end; ++row) {
        const Vec3 lower = (picture.top + static_cast<double>(row) * picture.step) * down;
        for (std::int64_t column = columns.begin; column < columns.end; ++column) {
            const Vec3 aside = (picture.left + static_cast<double>(column) * picture.step) * right + lower;
            const Entry entry = picture.perspective != 0 ? enter(volume, start, forward + aside) : enter(volume, start + aside, forward);
            const std::int64_t pixel = row * picture.width + column;
            const float depth = static_cast<float>(entry.at);
            if (!(depth < picture.depth[pixel]) || entry.at <= picture.nearest) continue;
            picture.depth[pixel] = depth;
            picture.which[pixel] = number;
            const Vec3 normal = out_of(volume.rotation, entry.normal);
            for (int k = 0; k < 3; ++k) picture.normal[3 * pixel + k] = static_cast<float>(normal[k]);
        }
    }
}

}  // namespace casting

// Draw the volumes in their order, then the surfaces; of two at the same depth the first is visible.
MOBEE_CALL void mobee_cast(const Picture* picture) {
    for (std::int64_t pixel = 0; pixel < picture->height * picture->width; ++pixel) {
        picture->depth[pixel] = std::numeric_limits<float>::infinity();
        picture->which[pixel] = -1;
        for (int k = 0; k < 3; ++k) picture->normal[3 * pixel + k] = 0.0F;
    }
    for (std::int64_t number = 0; number < picture->count; ++number) casting::draw(*picture, static_cast<std::int32_t>(number));
    for (std::int64_t number = 0; number < picture->surface_count; ++number) draw_surface(*picture, picture->surfaces[number]);
}

MOBEE_CALL std::int64_t mobee_convex_size() { return sizeof(Convex); }

MOBEE_CALL std::int64_t mobee_surface_size() { return sizeof(Surface); }

}  // namespace mobee
