// SPDX-License-Identifier: Apache-2.0
// Any two volumes: the function for their kinds; with a cylinder or a hull, iterations over the difference of their cores.
#include <limits>

#include "difference.hpp"
#include "narrow.hpp"

namespace mobee {

namespace narrow {

constexpr double infinity = std::numeric_limits<double>::infinity();

// The smallest separation along the axes of either volume, along cross products of two axes, or radially from the axis of either.
Separation natural(const Difference& difference) {
    const Vec3 first = {0.0, 0.0, 1.0}, second = difference.turn.column(2), shift = difference.shift;
    const Vec3 tried[9] = {{0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}, {1.0, 0.0, 0.0},
                           difference.turn.column(2), difference.turn.column(0), difference.turn.column(1),
                           {shift.x, shift.y, 0.0}, shift - dot(shift, second) * second, cross(first, second)};
    Separation best = {infinity, first};
    for (const Vec3 axis : tried) {
        const double size = length(axis);
        if (size <= tie) continue;
        const Vec3 n = over(axis, size);
        const Reach reach = difference.along(n);
        if (reach.high < best.reach - tie) best = {reach.high, n};
        if (-reach.low < best.reach - tie) best = {-reach.low, -n};
    }
    return best;
}

double general(const Volume& a, const Volume& b, Touch& touch) {
    const double apart = length(a.center - b.center) - a.bound - b.bound;
    if (apart >= 0.0) return -apart;
    Difference difference(a, b);
    const double round_off = rounding(a) + rounding(b);
    const auto [distance, point] = closest(difference, round_off);
    if (distance >= round_off && distance > 0.0) return round_off - distance;
    const Separation separation = distance > touching ? Separation{-distance, over(-point, distance)} : least_separation(difference, natural(difference));
    const double depth = separation.reach + round_off;
    if (depth > 0.0) touch = touch_along(a, b, out_of(a.rotation, separation.direction), depth);
    return depth;
}

double overlap_in_order(const Volume& a, const Volume& b, Touch& touch) {
    if (b.kind <= Kind::capsule) {
        if (a.kind == Kind::capsule) return capsule_capsule(a, b, touch);
        return b.kind == Kind::capsule ? sphere_capsule(a, b, touch) : sphere_sphere(a, b, touch);
    }
    if (b.kind == Kind::box && a.kind <= Kind::capsule) return a.kind == Kind::sphere ? sphere_box(a, b, touch) : capsule_box(a, b, touch);
    if (a.kind == Kind::box && b.kind == Kind::box) return box_box(a, b, touch);
    if (a.kind == Kind::sphere && b.kind == Kind::cylinder) return sphere_cylinder(a, b, touch);
    if (a.kind == Kind::capsule && b.kind == Kind::cylinder) return capsule_cylinder(a, b, touch);
    if (a.kind == Kind::cylinder && b.kind == Kind::cylinder) return cylinder_cylinder(a, b, touch);
    if (a.kind == Kind::cylinder && b.kind == Kind::box) return cylinder_box(a, b, touch);
    return general(a, b, touch);
}

}  // namespace narrow

double overlap(const Volume& a, const Volume& b, Touch& touch) {
    if (a.kind <= b.kind) return narrow::overlap_in_order(a, b, touch);
    const double depth = narrow::overlap_in_order(b, a, touch);
    if (depth > 0.0) touch.normal = -touch.normal;
    return depth;
}

double distance(const Volume& a, const Volume& b) {
    if (a.kind > b.kind) return distance(b, a);
    Touch unused;
    double apart = 0.0;
    if (a.kind == Kind::sphere && b.kind == Kind::box) {
        apart = -narrow::sphere_box(a, b, unused);
    } else if (a.kind == Kind::sphere && b.kind == Kind::cylinder) {
        apart = -narrow::sphere_cylinder(a, b, unused);
    } else if (b.kind <= Kind::capsule) {
        // A sphere is a capsule without length.
        apart = -narrow::capsule_capsule(a, b, unused);
    } else if (a.kind == Kind::capsule && b.kind == Kind::box) {
        apart = narrow::capsule_box_distance(a, b);
    } else if (a.kind == Kind::capsule && b.kind == Kind::cylinder) {
        apart = narrow::capsule_cylinder_distance(a, b);
    } else {
        narrow::Difference difference(a, b);
        apart = narrow::closest(difference, narrow::infinity).distance - narrow::rounding(a) - narrow::rounding(b);
    }
    return most(apart, 0.0);
}

}  // namespace mobee
