// SPDX-License-Identifier: Apache-2.0
// Two boxes: the separating axis theorem, over the faces of both and the crossings of their edges.
#include <limits>

#include "narrow.hpp"

namespace mobee::narrow {

namespace box_box_axes {

// The overlap along the cross product of two edges, not yet divided by its length hypot(p, q); parallel edges are allowed.
inline double edges(double t, double r, double p, double q) {
    const double squared = p * p + q * q;
    return squared > flat * flat ? (r - std::fabs(t)) / std::sqrt(squared) : std::numeric_limits<double>::infinity();
}

// The unit vector of one of the fifteen axes, root frame.
Vec3 direction(const Volume& a, const Volume& b, int which) {
    if (which < 3) return a.rotation.column(which);
    if (which < 6) return b.rotation.column(which - 3);
    const Vec3 n = cross(a.rotation.column((which - 6) / 3), b.rotation.column((which - 6) % 3));
    return over(n, length(n));
}

inline double smallest(Vec3 v) { return least(least(std::fabs(v.x), std::fabs(v.y)), std::fabs(v.z)); }

// The contact is at a corner if one of the boxes touches with a corner.
Touch contact(const Volume& a, const Volume& b, Vec3 n, double depth) {
    const Vec3 in_a = into(a.rotation, -n), in_b = into(b.rotation, n);
    const bool corner_of_a = smallest(in_a) > aligned;
    if (!corner_of_a && !(smallest(in_b) > aligned)) return touch_along(a, b, n, depth);
    const Volume& met = corner_of_a ? a : b;
    const Vec3 toward = corner_of_a ? in_a : in_b, half = met.half;
    const Vec3 corner = {std::copysign(half.x, toward.x), std::copysign(half.y, toward.y), std::copysign(half.z, toward.z)};
    return {n, met.center + out_of(met.rotation, corner) + (corner_of_a ? 0.5 : -0.5) * depth * n};
}

}  // namespace box_box_axes

double box_box(const Volume& a, const Volume& b, Touch& touch) {
    using box_box_axes::edges;
    const Vec3 t = into(a.rotation, a.center - b.center), h = a.half, k = b.half;
    // The second box's axes, seen from the first.
    const Vec3 x = into(a.rotation, b.rotation.column(0)), y = into(a.rotation, b.rotation.column(1)),
               z = into(a.rotation, b.rotation.column(2));
    const Vec3 ax = absolute(x), ay = absolute(y), az = absolute(z);
    double overlaps[15];
    overlaps[0] = h.x + k.x * ax.x + k.y * ay.x + k.z * az.x - std::fabs(t.x);
    overlaps[1] = h.y + k.x * ax.y + k.y * ay.y + k.z * az.y - std::fabs(t.y);
    overlaps[2] = h.z + k.x * ax.z + k.y * ay.z + k.z * az.z - std::fabs(t.z);
    double apart = least(least(overlaps[0], overlaps[1]), overlaps[2]);
    if (apart <= 0.0) return apart;
    overlaps[3] = dot(h, ax) + k.x - std::fabs(dot(x, t));
    overlaps[4] = dot(h, ay) + k.y - std::fabs(dot(y, t));
    overlaps[5] = dot(h, az) + k.z - std::fabs(dot(z, t));
    apart = least(least(overlaps[3], overlaps[4]), overlaps[5]);
    if (apart <= 0.0) return apart;
    // Along the cross products of the first box's axis x (y, z) and each axis of the second.
    overlaps[6] = edges(t.z * x.y - t.y * x.z, h.y * ax.z + h.z * ax.y + k.y * az.x + k.z * ay.x, x.y, x.z);
    overlaps[7] = edges(t.z * y.y - t.y * y.z, h.y * ay.z + h.z * ay.y + k.x * az.x + k.z * ax.x, y.y, y.z);
    overlaps[8] = edges(t.z * z.y - t.y * z.z, h.y * az.z + h.z * az.y + k.x * ay.x + k.y * ax.x, z.y, z.z);
    apart = least(least(overlaps[6], overlaps[7]), overlaps[8]);
    if (apart <= 0.0) return apart;
    overlaps[9] = edges(t.x * x.z - t.z * x.x, h.x * ax.z + h.z * ax.x + k.y * az.y + k.z * ay.y, x.x, x.z);
    overlaps[10] = edges(t.x * y.z - t.z * y.x, h.x * ay.z + h.z * ay.x + k.x * az.y + k.z * ax.y, y.x, y.z);
    overlaps[11] = edges(t.x * z.z - t.z * z.x, h.x * az.z + h.z * az.x + k.x * ay.y + k.y * ax.y, z.x, z.z);
    apart = least(least(overlaps[9], overlaps[10]), overlaps[11]);
    if (apart <= 0.0) return apart;
    overlaps[12] = edges(t.y * x.x - t.x * x.y, h.x * ax.y + h.y * ax.x + k.y * az.z + k.z * ay.z, x.x, x.y);
    overlaps[13] = edges(t.y * y.x - t.x * y.y, h.x * ay.y + h.y * ay.x + k.x * az.z + k.z * ax.z, y.x, y.y);
    overlaps[14] = edges(t.y * z.x - t.x * z.y, h.x * az.y + h.y * az.x + k.x * ay.z + k.y * ax.z, z.x, z.y);
    apart = least(least(overlaps[12], overlaps[13]), overlaps[14]);
    if (apart <= 0.0) return apart;
    int which = 0;
    for (int axis = 1; axis < 15; ++axis)
        if (overlaps[axis] < overlaps[which] - tie) which = axis;
    const Vec3 n = box_box_axes::direction(a, b, which);
    const double shift = dot(n, b.center - a.center), side = away(shift);
    // The opposite direction would be shorter; but if the centres coincide, rounding must not decide.
    const double depth = side * shift > 0.0 ? overlaps[which] + 2.0 * side * shift : overlaps[which];
    touch = box_box_axes::contact(a, b, side * n, depth);
    return depth;
}

}  // namespace mobee::narrow
