// SPDX-License-Identifier: Apache-2.0
#include "difference.hpp"

#include <limits>

namespace mobee::narrow {

namespace core_support {

constexpr std::int32_t few = 100;  // corners: testing all of so many takes less time than a search along edges

// Tests four at a time, without branches.
std::int32_t farthest_of_all(const Hull& hull, Vec3 v) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    double farthest[4] = {-infinity, -infinity, -infinity, -infinity};
    std::int32_t at[4] = {0, 0, 0, 0};
    std::int32_t k = 0;
    for (; k + 4 <= hull.count; k += 4) {
        for (std::int32_t lane = 0; lane < 4; ++lane) {
            const double along = dot(v, hull.corners[k + lane]);
            const bool better = along > farthest[lane];
            farthest[lane] = better ? along : farthest[lane];
            at[lane] = better ? k + lane : at[lane];
        }
    }
    for (; k < hull.count; ++k) {
        const double along = dot(v, hull.corners[k]);
        if (along > farthest[0]) farthest[0] = along, at[0] = k;
    }
    for (int lane = 1; lane < 4; ++lane)
        if (farthest[lane] > farthest[0]) farthest[0] = farthest[lane], at[0] = at[lane];
    return at[0];
}

Reach of_corners(const Hull& hull, Vec3 n) {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    double low[4] = {infinity, infinity, infinity, infinity}, high[4] = {-infinity, -infinity, -infinity, -infinity};
    std::int32_t k = 0;
    for (; k + 4 <= hull.count; k += 4) {
        for (std::int32_t lane = 0; lane < 4; ++lane) {
            const double along = dot(n, hull.corners[k + lane]);
            low[lane] = least(along, low[lane]);
            high[lane] = most(along, high[lane]);
        }
    }
    for (; k < hull.count; ++k) {
        const double along = dot(n, hull.corners[k]);
        low[0] = least(along, low[0]);
        high[0] = most(along, high[0]);
    }
    return {least(least(low[0], low[1]), least(low[2], low[3])), most(most(high[0], high[1]), most(high[2], high[3]))};
}

// The best of the first few corners that have edges; -1 if there is none.
std::int32_t first_corner(const Hull& hull, Vec3 v) {
    std::int32_t best = -1, looked_at = 0;
    for (std::int32_t k = 0; k < hull.count && looked_at < 6; ++k) {
        if (hull.starts[k] == hull.starts[k + 1]) continue;
        if (best < 0 || dot(v, hull.corners[k]) > dot(v, hull.corners[best])) best = k;
        ++looked_at;
    }
    return best;
}

// Moves from a corner along edges that lead farther along v, until there is none.
std::int32_t climb(const Hull& hull, Vec3 v, std::int32_t from) {
    double farthest = dot(v, hull.corners[from]);
    for (std::int32_t at = from;; at = from) {
        for (std::int32_t k = hull.starts[at]; k < hull.starts[at + 1]; ++k) {
            const double along = dot(v, hull.corners[hull.edges[k]]);
            if (along > farthest) from = hull.edges[k], farthest = along;
        }
        if (from == at) return at;
    }
}

// The corner of a hull that is farthest along v; `last` is where the search starts, and then that corner.
Vec3 of_hull(const Hull& hull, Vec3 v, std::int32_t& last) {
    if (hull.edges != nullptr && hull.count > few) {
        if (last < 0) last = first_corner(hull, v);
        if (last >= 0) return hull.corners[last = climb(hull, v, last)];
    }
    return hull.corners[farthest_of_all(hull, v)];
}

// The point of a core that is farthest along v, both in its own axes.
Vec3 of_core(const Volume& volume, Vec3 v, std::int32_t& last) {
    const Vec3 half = volume.half;
    switch (volume.kind) {
        case Kind::sphere: return {};
        case Kind::capsule: return {0.0, 0.0, std::copysign(half.y, v.z)};
        case Kind::box: return {std::copysign(half.x, v.x), std::copysign(half.y, v.y), std::copysign(half.z, v.z)};
        case Kind::cylinder: {
            const double side = std::sqrt(v.x * v.x + v.y * v.y), z = std::copysign(half.y, v.z);
            if (side == 0.0) return {half.x, 0.0, z};
            return {half.x * v.x / side, half.x * v.y / side, z};
        }
        case Kind::convex: break;
    }
    return of_hull(volume.hull, v, last);
}

// The interval of a core along n, in its own axes.
Reach of_core_along(const Volume& volume, Vec3 n) {
    const Vec3 half = volume.half;
    double high = 0.0;
    switch (volume.kind) {
        case Kind::sphere: break;
        case Kind::capsule: high = half.y * std::fabs(n.z); break;
        case Kind::box: high = dot(half, absolute(n)); break;
        case Kind::cylinder: high = half.x * std::sqrt(n.x * n.x + n.y * n.y) + half.y * std::fabs(n.z); break;
        case Kind::convex: return of_corners(volume.hull, n);
    }
    return {-high, high};
}

bool holds(const Volume& v, Vec3 point) {
    const Vec3 p = into(v.rotation, point - v.center), half = v.half;
    if (v.kind == Kind::box) return std::fabs(p.x) < half.x && std::fabs(p.y) < half.y && std::fabs(p.z) < half.z;
    return p.x * p.x + p.y * p.y < half.x * half.x && std::fabs(p.z) < half.y;
}

// The radius of the largest ball about a point that is inside; below 0 for a point outside.
double inside(const Volume& v, Vec3 point) {
    const Vec3 p = absolute(into(v.rotation, point - v.center)), half = v.half;
    if (v.kind == Kind::box) return least(least(half.x - p.x, half.y - p.y), half.z - p.z);
    return least(half.x - std::sqrt(p.x * p.x + p.y * p.y), half.y - p.z);
}

}  // namespace core_support

bool known_to_meet(const Volume& a, const Volume& b, Vec3 point) {
    using core_support::holds;
    return (holds(a, point) && holds(b, point)) || holds(a, b.center) || holds(b, a.center);
}

// If the same point has a ball of radius r inside one volume and a ball of radius s inside the other, the difference contains a ball of
// radius r + s about the origin.  If a vertex of one is inside a face of the other, or two edges cross, a deepest point gives the best bound.
double separation_bound(const Volume& a, const Volume& b, const Touch& touch, double length) {
    double bound = 0.0;
    for (const double along : {0.0, 0.5, -0.5}) {
        const Vec3 point = touch.point + along * length * touch.normal;
        const double in_a = core_support::inside(a, point), in_b = core_support::inside(b, point);
        if (in_a > -touching && in_b > -touching) bound = most(bound, in_a + in_b);
    }
    return bound;
}

Difference::Difference(const Volume& a, const Volume& b) : first(a), second(b), shift(into(a.rotation, b.center - a.center)) {
    for (int column = 0; column < 3; ++column) {
        const Vec3 axis = into(a.rotation, b.rotation.column(column));
        turn.m[column] = axis.x;
        turn.m[3 + column] = axis.y;
        turn.m[6 + column] = axis.z;
    }
}

Vec3 Difference::farthest(Vec3 n) {
    return shift + out_of(turn, core_support::of_core(second, into(turn, n), corner_of_second)) - core_support::of_core(first, -n, corner_of_first);
}

Reach Difference::along(Vec3 n) const {
    const Reach of_first = core_support::of_core_along(first, n), of_second = core_support::of_core_along(second, into(turn, n));
    const double middle = dot(n, shift);
    return {middle + of_second.low - of_first.high, middle + of_second.high - of_first.low};
}

double Difference::apart() { return closest(*this, 0.0).distance; }

}  // namespace mobee::narrow
