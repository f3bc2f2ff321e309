// SPDX-License-Identifier: Apache-2.0
// A cylinder with a sphere, a capsule or a box: closed forms, and smooth minima along the outlines of their difference.
#include <limits>

#include "difference.hpp"
#include "lanes.hpp"
#include "narrow.hpp"
#include "outline.hpp"

namespace mobee::narrow {

namespace cylinder {

constexpr double infinity = std::numeric_limits<double>::infinity();

inline int after(int axis) { return axis == 2 ? 0 : axis + 1; }
inline int before(int axis) { return axis == 0 ? 2 : axis - 1; }

inline Vec3 axis_of(int i) {
    Vec3 e;
    e[i] = 1.0;
    return e;
}

// The Minkowski difference of segments along three axes (a box, or the core of a capsule) and a cylinder, in the frame of those axes.
// Its smallest separation is along the cylinder's axis c, along an axis of a box, across c and a segment, or a smooth minimum among the
// directions perpendicular to c or to a segment.  (Where the rim meets a corner, the reach has no minimum.)
struct Swept {
    Vec3 shift;  // from the cylinder's centre to that of the segments
    Vec3 half;   // of the segments
    Vec3 axis;   // c
    double radius, height;
    Vec3 beside;  // the length of the cross product of c and each segment
    Vec3 moment;  // shift x c

    Swept(const Volume& round, const Volume& other, Vec3 halves)
        : shift(into(other.rotation, other.center - round.center)), half(halves), axis(into(other.rotation, round.rotation.column(2))),
          radius(round.half.x), height(round.half.y) {
        const Vec3 c = axis;
        beside = {std::sqrt(c.y * c.y + c.z * c.z), std::sqrt(c.z * c.z + c.x * c.x), std::sqrt(c.x * c.x + c.y * c.y)};
        moment = cross(shift, c);
    }

    // The extent of the difference from `shift` along c, along the axes of a box, and along the cross product of c and a segment.
    double along_cylinder() const { return dot(half, absolute(axis)) + height; }
    Vec3 along_box() const { return half + height * absolute(axis) + radius * beside; }
    double across(int i) const {
        const int j = after(i), k = before(i);
        return beside[i] > flat ? (half[j] * std::fabs(axis[k]) + half[k] * std::fabs(axis[j])) / beside[i] + radius : infinity;
    }
    Vec3 normal_across(int i) const { return over(cross(axis_of(i), axis), beside[i]); }
    // The component of the shift along that normal.
    double shift_across(int i) const { return beside[i] > flat ? -moment[i] / beside[i] : 0.0; }

    // The reach of the difference along a unit vector.
    double reach(Vec3 n) const {
        return dot(n, shift) + dot(half, absolute(n)) + height * std::fabs(dot(n, axis)) + radius * length(cross(n, axis));
    }
};

inline double smallest(Vec3 v) { return least(least(v.x, v.y), v.z); }

// Replace the best separation by the one along an axis, or against it, if that is smaller.
inline void prefer(Separation& best, Vec3 n, double extent, double shift) {
    const double reach = extent + away(shift) * shift;
    if (reach < best.reach - tie) best = {reach, away(shift) * n};
}

// Perpendicular to c: away from the corner of the segments' outline that is closest to c.
void prefer_away_from_corner(Separation& best, const Swept& swept) {
    const Vec3 c = swept.axis, half = swept.half;
    double nearest = infinity;
    Vec3 corner;
    for (int k = 0; k < 8; ++k) {
        const Vec3 p = swept.shift + Vec3{k & 1 ? half.x : -half.x, k & 2 ? half.y : -half.y, k & 4 ? half.z : -half.z};
        const Vec3 q = p - dot(p, c) * c;
        if (dot(q, q) < nearest) corner = q, nearest = dot(q, q);
    }
    corner = corner - dot(corner, c) * c;  // again, since rounding errors are large for a corner near the axis
    const double size = length(corner);
    if (size <= touching) return;
    const Vec3 n = over(-corner, size);
    const double reach = swept.reach(n);
    if (reach < best.reach - tie) best = {reach, n};
}

// For three axes: the axis after each in cyclic order, and the axis before.
inline Four afters(Vec3 v) { return Four{v.y, v.z, v.x, 0.0}; }
inline Four befores(Vec3 v) { return Four{v.z, v.x, v.y, 0.0}; }

// Bit k: whether the smooth part of outline k about the origin, along a chord from a given point, and its mirror image about `shift`, are not
// nearer than a limit; `reach`: reach at the first point, of which `off` is due to the shift.
struct Parts {
    Four shift_x, shift_y;
    double limit;

    // (Without a visible disc the numbers are NaN, and nothing is ruled out.)
    unsigned beyond(Four reach, Four off, Four x, Four y, Four chord_x, Four chord_y) const {
        const Four area = (x * chord_y - y * chord_x) - absolute_of(shift_x * chord_y - shift_y * chord_x);
        const Four nearest = least_of(reach - absolute_of(off), area / root_of(chord_x * chord_x + chord_y * chord_y));
        return less(Four{} + limit, nearest);
    }
};

// Bit i: whether a smooth minimum perpendicular to axis i may be below the limit, by the chords of the outlines, see `improve_around`.
unsigned where_around(const Swept& swept, double limit) {
    const Four one{1.0, 1.0, 1.0, 1.0};
    const Four x = afters(swept.axis), y = befores(swept.axis), turn = x * y < -1e-12 ? -one : one;
    const Four c_x = absolute_of(x), c_y = absolute_of(y), size = four(swept.beside);
    const Four half_x = afters(swept.half), half_y = befores(swept.half), end_x = swept.height * c_x, end_y = swept.height * c_y;
    const Parts parts = {turn * afters(swept.shift), befores(swept.shift), limit};
    // The reach of the disc along the plane's axes and perpendicular to the cylinder's, and the offsets of these points.
    const Four beside_x = afters(swept.beside), beside_y = befores(swept.beside), both = swept.radius * c_x * c_y;
    const Four out_x = swept.radius * beside_x, off_x = both / beside_x, out_y = swept.radius * beside_y, off_y = both / beside_y;
    const auto leans = size > flat;
    const Four square_x = leans ? -c_y / size : -one, square_y = leans ? c_x / size : Four{};
    const Four edge_x = swept.radius * square_x, edge_y = swept.radius * square_y;

    Four from_x = half_x + end_x + out_x, from_y = half_y + end_y - off_x;
    unsigned hopeless = parts.beyond(from_x, parts.shift_x, from_x, from_y, -off_y - out_x, out_y + off_x);
    from_x = end_x - half_x - off_y, from_y = half_y + end_y + out_y;
    hopeless &= parts.beyond(from_y, parts.shift_y, from_x, from_y, edge_x + off_y, edge_y - out_y);
    from_x = edge_x - half_x - end_x, from_y = edge_y + half_y - end_y;
    const Four off = square_x * parts.shift_x + square_y * parts.shift_y;
    hopeless &= parts.beyond(square_x * from_x + square_y * from_y, off, from_x, from_y, -out_x - edge_x, off_x - edge_y);
    return ~hopeless & 7u;
}

// Perpendicular to the segment along axis i.
void prefer_around(Separation& best, const Swept& swept, int i) {
    const int j = after(i), k = before(i);
    const Vec3 c = swept.axis;
    const Point axis = {c[j], c[k]};
    const Disc disc = {swept.radius, axis, swept.height * axis, c[i] * c[i], 0.0};
    Exit exit = {best.reach, {}};
    improve_around(disc, {swept.shift[j], swept.shift[k]}, {swept.half[j], swept.half[k]}, exit);
    if (!(exit.reach < best.reach)) return;
    best.reach = exit.reach;
    best.direction[i] = 0.0;
    best.direction[j] = exit.n.x;
    best.direction[k] = exit.n.y;
}

// A segment c + s h, |s| <= 1, and a cylinder about the z axis: their distance at s, and half the slope of its square.
struct Apart {
    double s;
    Vec3 to_point;  // from the cylinder
    double distance, slope, rise;

    Apart(Vec3 c, Vec3 h, double radius, double height, double at) : s(at) {
        const Vec3 p = c + s * h;
        const double side = std::sqrt(p.x * p.x + p.y * p.y), beyond = most(side - radius, 0.0), share = beyond > 0.0 ? beyond / side : 0.0;
        to_point = {share * p.x, share * p.y, p.z - clamp(p.z, -height, height)};
        distance = std::sqrt(beyond * beyond + to_point.z * to_point.z);
        slope = dot(to_point, h);
        const double across = beyond > 0.0 ? (p.x * h.x + p.y * h.y) / side : 0.0;
        rise = across * across + share * (h.x * h.x + h.y * h.y - across * across) + (to_point.z != 0.0 ? h.z * h.z : 0.0);
        if (beyond <= 0.0) rise = to_point.z != 0.0 ? h.z * h.z : 0.0;
    }
    // A lower bound for all points of the segment: their distance from the plane perpendicular to `to_point` that touches the cylinder.
    double bound() const { return distance > 0.0 ? distance - std::fabs(slope) / distance * (slope > 0.0 ? 1.0 + s : 1.0 - s) : 0.0; }
};

// The distance of the two; once it is known to be more than `limit`, a lower bound that is also more.
Apart closest_to_cylinder(Vec3 c, Vec3 h, const Volume& round, double inverse, double limit, double& bound) {
    double low = -1.0, high = 1.0;
    Apart here(c, h, round.half.x, round.half.y, unit(-dot(c, h) * inverse));
    for (int step = 0; step < 60; ++step) {
        const double s = here.s;
        bound = here.bound();
        if ((bound >= limit && bound > 0.0) || here.distance <= touching) break;
        (here.slope > 0.0 ? high : low) = s;
        double next = here.rise > 0.0 ? s - here.slope / here.rise : here.slope > 0.0 ? -1.0 : 1.0;
        if (!(next > low && next < high)) next = next <= low && low == -1.0 ? -1.0 : next >= high && high == 1.0 ? 1.0 : (low + high) / 2.0;
        if (std::fabs(next - s) < 1e-15) break;
        here = Apart(c, h, round.half.x, round.half.y, next);
    }
    return here;
}

}  // namespace cylinder

double sphere_cylinder(const Volume& a, const Volume& b, Touch& touch) {
    const Vec3 c = into(b.rotation, a.center - b.center);
    const double side = std::sqrt(c.x * c.x + c.y * c.y), across = side - b.half.x, along = std::fabs(c.z) - b.half.y;
    const double dx = most(across, 0.0), dz = most(along, 0.0), distance = std::sqrt(dx * dx + dz * dz);
    if (distance >= a.radius) return a.radius - distance;
    const Vec3 outward = side > touching ? Vec3{c.x / side, c.y / side, 0.0} : Vec3{1.0, 0.0, 0.0};
    Vec3 n = {0.0, 0.0, sign(c.z)};
    double apart = n.z * c.z - b.half.y;
    if (distance > touching) {
        n = (dx / distance) * outward + (dz / distance) * n;
        apart = distance;
    } else if (across > along + tie) {
        n = outward;
        apart = across;
    }
    touch = {out_of(b.rotation, n), b.center + out_of(b.rotation, c - 0.5 * (a.radius + apart) * n)};
    return a.radius - apart;
}

double cylinder_box(const Volume& a, const Volume& b, Touch& touch) {
    using namespace cylinder;
    const Swept swept(a, b, b.half);
    const double along = swept.along_cylinder(), off = dot(swept.shift, swept.axis);
    const Vec3 box = swept.along_box(), across = {swept.across(0), swept.across(1), swept.across(2)};
    const Vec3 aside = {swept.shift_across(0), swept.shift_across(1), swept.shift_across(2)};
    const double between = smallest(across - absolute(aside));
    const double apart = least(least(along - std::fabs(off), between), smallest(box - absolute(swept.shift)));
    if (apart <= 0.0) return apart;
    Separation best = {infinity, {}};
    prefer(best, swept.axis, along, off);
    for (const int i : {2, 0, 1}) prefer(best, axis_of(i), box[i], swept.shift[i]);
    for (int i = 0; i < 3; ++i) prefer(best, swept.normal_across(i), across[i], aside[i]);
    // If the cylinder's axis passes outside of the box, a corner may be closest.
    if (between < swept.radius) prefer_away_from_corner(best, swept);
    unsigned around = where_around(swept, best.reach - tie);
    for (int i = 0; around != 0; ++i, around >>= 1)
        if ((around & 1u) != 0) prefer_around(best, swept, i);
    if (best.reach <= 0.0) return best.reach;
    const Touch found = touch_along(a, b, out_of(b.rotation, best.direction), best.reach);
    const double gap = known_to_meet(a, b, found.point) ? 0.0 : Difference(a, b).apart();
    if (gap > 0.0) return -gap;
    touch = found;
    return best.reach;
}

double capsule_cylinder(const Volume& a, const Volume& b, Touch& touch) {
    using namespace cylinder;
    const Vec3 c = into(b.rotation, a.center - b.center), h = into(b.rotation, a.core);
    double bound = 0.0;
    const Apart apart = closest_to_cylinder(c, h, b, a.inverse, a.radius, bound);
    if (bound >= a.radius && bound > 0.0) return a.radius - bound;
    if (apart.distance > touching) {
        if (apart.distance >= a.radius) return a.radius - apart.distance;
        const double depth = a.radius - apart.distance;
        // Between its ends, `to_point` is perpendicular to the segment; rounding spoils this if the segment is long and the distance small.
        const Vec3 to_point = std::fabs(apart.s) < 1.0 - flat ? apart.to_point - apart.slope * a.inverse * h : apart.to_point;
        touch = touch_along(a, b, out_of(b.rotation, over(to_point, length(to_point))), depth);
        return depth;
    }
    // The core overlaps the cylinder.
    const Swept swept(b, a, {0.0, 0.0, a.half.y});
    Separation best = {infinity, {}};
    prefer(best, swept.axis, swept.along_cylinder(), dot(swept.shift, swept.axis));
    for (int i = 2; i >= 0; --i) prefer(best, swept.normal_across(i), swept.across(i), swept.shift_across(i));
    prefer_away_from_corner(best, swept);
    prefer_around(best, swept, 2);
    const double depth = a.radius + best.reach;
    touch = touch_along(a, b, out_of(a.rotation, -best.direction), depth);
    return depth;
}

double capsule_cylinder_distance(const Volume& a, const Volume& b) {
    using namespace cylinder;
    const Vec3 c = into(b.rotation, a.center - b.center), h = into(b.rotation, a.core);
    double bound = 0.0;
    return most(closest_to_cylinder(c, h, b, a.inverse, infinity, bound).distance - a.radius, 0.0);
}

}  // namespace mobee::narrow
