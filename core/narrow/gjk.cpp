// SPDX-License-Identifier: Apache-2.0
// The algorithm of Gilbert, Johnson and Keerthi: the point of a Minkowski difference that is closest to the origin.
#include <limits>

#include "difference.hpp"

namespace mobee::narrow {

namespace gjk {

constexpr int steps = 100;
constexpr double exact = 1e-15;   // relative difference at which the bounds count as equal
constexpr double origin = 1e-12;  // m, or relative to a size: a simplex this close to the origin contains it
constexpr double thin = 1e-28;    // squared sine of the angle below which a triangle is one of its sides
constexpr double level = 1e-24;   // squared sine of the angle below which a tetrahedron is one of its faces
constexpr double infinity = std::numeric_limits<double>::infinity();

struct Simplex {
    Vec3 corner[4];
    int count = 0;
};

// The point of a triangle closest to the origin, and the corners of the face, side or corner on which it lies.
struct OnTriangle {
    Vec3 point;
    bool kept[3] = {false, false, false};
};

// Return whether the origin, seen against n, is to the right of the line from p to q.
inline bool right_of(Vec3 p, Vec3 q, Vec3 n) { return dot(n, cross(q - p, p)) > 0.0; }

OnTriangle on_triangle(Vec3 p, Vec3 q, Vec3 r) {
    const Vec3 n = cross(q - p, r - p);
    const double squared = dot(n, n);
    const bool is_thin = squared <= thin * dot(q - p, q - p) * dot(r - p, r - p);
    if (!(is_thin || right_of(p, q, n) || right_of(q, r, n) || right_of(r, p, n))) {
        // Computed from the normal, which is exact also for a narrow triangle.
        return {(dot(n, p) / squared) * n, {true, true, true}};
    }
    OnTriangle found;
    double nearest = infinity;
    const Vec3 corner[3] = {p, q, r};
    constexpr int sides[3][2] = {{0, 1}, {1, 2}, {0, 2}};
    for (const auto [from, to] : sides) {
        const Vec3 u = corner[to] - corner[from];
        const double along = -dot(u, corner[from]), whole = dot(u, u);
        const double w = along <= 0.0 ? 0.0 : along >= whole ? 1.0 : along / whole;
        Vec3 point = corner[from] + w * u;
        if (along > 0.0 && along < whole) point = point - (dot(u, point) / whole) * u;  // perpendicular to the side also if it is much shorter
        if (dot(point, point) < nearest) {
            nearest = dot(point, point);
            found = {point, {false, false, false}};
            found.kept[from] = w != 1.0;
            found.kept[to] = w != 0.0;
        }
    }
    return found;
}

// Return whether the origin and the other corner are not on the same side of the face p, q, r; true also if the four are in one plane.
bool beyond(Vec3 p, Vec3 q, Vec3 r, Vec3 other) {
    const Vec3 n = cross(q - p, r - p), o = other - p;
    const double side = dot(n, o), here = -dot(n, p);
    return side * side <= level * dot(n, n) * dot(o, o) || here * side <= 0.0;
}

// Keep the corners of a simplex that span its point closest to the origin, and return that; with all four kept, it is inside.
// A difference that is known not to contain the origin is treated so in spite of rounding errors for a thin tetrahedron.
Vec3 reduce(Simplex& simplex, bool apart) {
    Vec3* corner = simplex.corner;
    const int count = simplex.count;
    if (count == 1) return corner[0];
    // Of up to four triangles, each without one corner; fewer corners are a triangle with corners given twice.
    constexpr int others[4][3] = {{1, 2, 3}, {0, 2, 3}, {0, 1, 3}, {0, 1, 2}};
    const int few[3] = {0, 1, count - 1};
    OnTriangle best;
    const int* face = nullptr;
    double nearest = infinity;
    for (int other = 0; other < (count == 4 ? 4 : 1); ++other) {
        const int* at = count == 4 ? others[other] : few;
        const Vec3 p = corner[at[0]], q = corner[at[1]], r = corner[at[2]];
        if (count < 4 || apart || beyond(p, q, r, corner[other])) {
            const OnTriangle found = on_triangle(p, q, r);
            const double squared = dot(found.point, found.point);
            if (squared < nearest) best = found, face = at, nearest = squared;
        }
    }
    simplex.count = face == nullptr ? 4 : 0;
    if (face == nullptr) return {};
    for (int k = 0; k < 3; ++k)
        if (best.kept[k]) corner[simplex.count++] = corner[face[k]];
    return best.point;
}

}  // namespace gjk

Nearest closest(Difference& difference, double limit) {
    gjk::Simplex simplex;
    Vec3 point = difference.shift;
    double squared = gjk::infinity, apart = length(point);
    const double origin = most(gjk::origin, 4e-15 * (apart + difference.first.bound + difference.second.bound));
    for (int step = 0; step < gjk::steps; ++step) {
        if (apart < origin) {
            if (simplex.count > 0) return {0.0, {}};
            point = {1.0, 0.0, 0.0};
            apart = 1.0;
        }
        const Vec3 p = difference.farthest(-point);
        const double bound = dot(point, p) / apart;
        if (bound > limit) return {bound, point};
        if (simplex.count > 0 && apart - bound <= gjk::exact * apart) break;
        simplex.corner[simplex.count++] = p;
        const Vec3 next = gjk::reduce(simplex, bound > 0.0);
        if (simplex.count == 4) return {0.0, {}};
        const double nearer = dot(next, next);
        if (nearer >= squared) break;
        point = next, squared = nearer, apart = std::sqrt(nearer);
    }
    return {apart, point};
}

}  // namespace mobee::narrow
