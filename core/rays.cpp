// SPDX-License-Identifier: Apache-2.0
// Pictures of convex volumes and of surfaces: a ray through the middle of each pixel, and the volume that it enters first.
#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <limits>

#include "interface.hpp"
#include "lanes.hpp"
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
        case Kind::box: break;  // see draw_box
        case Kind::convex: return into_hull(start, along, volume.planes, volume.count);
    }
    return {};
}

// The pixels in which a volume can be visible.
struct Region {
    Pixels rows, columns;
};

Region region_of_sphere(const Picture& picture, Vec3 from, double radius) {
    const double ahead = dot(from, picture.ahead);
    if (ahead + radius <= picture.nearest) return {};
    return {pixels_of(picture, dot(from, picture.down), ahead, radius, picture.top, picture.height),
            pixels_of(picture, dot(from, picture.right), ahead, radius, picture.left, picture.width)};
}

// The part of a box farther than half of `nearest` is the hull of its corners there, and of the points where its edges reach that plane.
Region region_of_box(const Picture& picture, const Convex& box, Vec3 from) {
    Vec3 corners[8];
    for (int k = 0; k < 8; ++k) {
        Vec3 half = box.half;
        for (int axis = 0; axis < 3; ++axis)
            if ((k >> axis & 1) == 0) half[axis] = -half[axis];
        const Vec3 at = from + out_of(box.rotation, half);
        corners[k] = {dot(at, picture.right), dot(at, picture.down), dot(at, picture.ahead)};
    }
    double left = infinity, right = -infinity, top = infinity, bottom = -infinity;
    const auto include = [&](Vec3 at) {
        const double by = picture.perspective != 0 ? 1.0 / at.z : 1.0, x = at.x * by, y = at.y * by;
        left = least(left, x), right = most(right, x), top = least(top, y), bottom = most(bottom, y);
    };
    const double plane = 0.5 * picture.nearest;
    for (int k = 0; k < 8; ++k) {
        const Vec3 here = corners[k];
        if (picture.perspective == 0 || here.z >= plane) include(here);
        for (int bit = 1; bit < 8 && picture.perspective != 0; bit <<= 1) {
            const Vec3 next = corners[k | bit];
            if ((here.z >= plane) != (next.z >= plane)) include(here + ((plane - here.z) / (next.z - here.z)) * (next - here));
        }
    }
    if (left > right) return {};
    const auto pixels = [&](double low, double high, double first, std::int64_t size) {
        const double last = static_cast<double>(size);
        const double begin = std::floor((low - first) / picture.step), end = std::ceil((high - first) / picture.step) + 1.0;
        return Pixels{static_cast<std::int64_t>(clamp(begin, 0.0, last)), static_cast<std::int64_t>(clamp(end, 0.0, last))};
    };
    return {pixels(top, bottom, picture.top, picture.height), pixels(left, right, picture.left, picture.width)};
}

// Where the rays of a picture begin and run, in the axes of a volume.
struct View {
    bool perspective;
    Vec3 start, forward, right, down;

    View(const Picture& picture, const Convex& volume, Vec3 from)
        : perspective(picture.perspective != 0),
          start(into(volume.rotation, -from)),
          forward(into(volume.rotation, picture.ahead)),
          right(into(volume.rotation, picture.right)),
          down(into(volume.rotation, picture.down)) {}

    Vec3 start_of(Vec3 aside) const { return perspective ? start : start + aside; }
    Vec3 along(Vec3 aside) const { return perspective ? forward + aside : forward; }
};

void draw_rays(const Picture& picture, const Convex& volume, std::int32_t number, const View& view, const Region& region) {
    for (std::int64_t row = region.rows.begin; row < region.rows.end; ++row) {
        const Vec3 lower = (picture.top + static_cast<double>(row) * picture.step) * view.down;
        const std::int64_t end = picture.ray_at(row, region.columns.end);
        for (std::int64_t ray = picture.ray_at(row, region.columns.begin); ray < end; ++ray) {
            const double x = picture.left + static_cast<double>(picture.column_of(ray, row)) * picture.step;
            const Vec3 aside = x * view.right + lower;
            const Entry entry = enter(volume, view.start_of(aside), view.along(aside));
            const float depth = static_cast<float>(entry.at);
            if (depth < picture.depth[ray] && entry.at > picture.nearest)
                picture.set(ray, depth, number, out_of(volume.rotation, entry.normal));
        }
    }
}

// Four rays at once: most pixels show boxes, such as tables and sheets of paper.
void draw_box(const Picture& picture, const Convex& box, std::int32_t number, const View& view, const Region& region) {
    Vec3 outward[6];
    for (int side = 0; side < 6; ++side) {
        Vec3 normal;
        normal[side / 2] = side % 2 == 0 ? 1.0 : -1.0;
        outward[side] = out_of(box.rotation, normal);
    }
    const Four nothing = Four{} - infinity;
    for (std::int64_t row = region.rows.begin; row < region.rows.end; ++row) {
        const Vec3 lower = (picture.top + static_cast<double>(row) * picture.step) * view.down;
        const std::int64_t end = picture.ray_at(row, region.columns.end);
        for (std::int64_t ray = picture.ray_at(row, region.columns.begin); ray < end; ray += 4) {
            const Four x = picture.left + picture.columns_of(ray, row) * picture.step;
            Four enter = nothing, leave = -nothing, side{};
            for (int k = 0; k < 3; ++k) {
                const Four aside = x * view.right[k] + lower[k];
                const Four start = view.perspective ? Four{} + view.start[k] : view.start[k] + aside;
                const Four along = view.perspective ? view.forward[k] + aside : Four{} + view.forward[k];
                const Four before = box.half[k] - start, behind = box.half[k] + start;
                const Four one = before / along, other = behind / -along;  // where the ray crosses the two sides
                const Four outside = (before < 0.0) | (behind < 0.0) ? nothing : -nothing;
                const Four first = along < 0.0 ? one : along > 0.0 ? other : nothing;
                const Four last = along < 0.0 ? other : along > 0.0 ? one : outside;
                const Four entered = along < 0.0 ? Four{} + 2.0 * k : Four{} + (2.0 * k + 1.0);
                side = first > enter ? entered : side;
                enter = first > enter ? first : enter;
                leave = last < leave ? last : leave;
            }
            unsigned hit = less(Four{} + picture.nearest, enter) & ~less(leave, enter);
            if (ray + 4 > end) hit &= (1U << (end - ray)) - 1U;
            for (; hit != 0; hit &= hit - 1) {
                const int k = std::countr_zero(hit);
                const float depth = static_cast<float>(enter[k]);
                if (depth < picture.depth[ray + k]) picture.set(ray + k, depth, number, outward[static_cast<int>(side[k])]);
            }
        }
    }
}

void draw(const Picture& picture, std::int32_t number) {
    const Convex& volume = picture.volumes[number];
    const Vec3 from = volume.center - picture.origin;
    const bool is_box = static_cast<Kind>(volume.kind) == Kind::box;
    const Region region = is_box ? region_of_box(picture, volume, from) : region_of_sphere(picture, from, volume.bound);
    if (region.rows.begin >= region.rows.end || region.columns.begin >= region.columns.end) return;
    (is_box ? draw_box : draw_rays)(picture, volume, number, View(picture, volume, from), region);
}

}  // namespace casting

// Draw the volumes in their order, then the surfaces; of two at the same depth the first is visible.
MOBEE_CALL void mobee_cast(const Picture* picture) {
    for (std::int64_t ray = 0; ray < picture->rays; ++ray) {
        picture->depth[ray] = std::numeric_limits<float>::infinity();
        picture->which[ray] = -1;
    }
    std::memset(picture->normal, 0, static_cast<std::size_t>(3 * picture->rays) * sizeof(float));
    for (std::int64_t number = 0; number < picture->count; ++number) casting::draw(*picture, static_cast<std::int32_t>(number));
    for (std::int64_t number = 0; number < picture->surface_count; ++number) draw_surface(*picture, picture->surfaces[number]);
}

// The brightness of what some rays meet, in the light of one lamp; see `Light` of picture.hpp.
MOBEE_CALL void mobee_shade(const Light* light) {
    for (std::int64_t pixel = 0; pixel < light->count; ++pixel) {
        const std::int64_t ray = light->rays[pixel];
        const float* normal = light->normal + 3 * ray;
        float* out = light->brightness + 3 * pixel;
        const std::int32_t which = light->which[ray];
        if (which < 0) {
            for (int k = 0; k < 3; ++k) out[k] += light->nothing[k];
            continue;
        }
        // In single precision, but each product is exact, as where a processor multiplies and adds in one step.
        float facing = static_cast<float>(light->towards[1] * normal[1]);
        facing = static_cast<float>(light->towards[0] * normal[0] + facing);
        facing = static_cast<float>(light->towards[2] * normal[2] + facing);
        const float strength = light->ambient + light->diffuse * (facing > 0.0F ? facing : 0.0F);
        for (int k = 0; k < 3; ++k) {
            const float value = light->colors[3 * which + k] * strength;
            out[k] += value < 255.0F ? value : 255.0F;
        }
    }
}

MOBEE_CALL std::int64_t mobee_convex_size() { return sizeof(Convex); }

MOBEE_CALL std::int64_t mobee_surface_size() { return sizeof(Surface); }

}  // namespace mobee
