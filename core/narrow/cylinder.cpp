// Cylinders with spheres, capsules and boxes: closed forms, and smooth minima along the outlines of their difference.
#include <limits>

#include "difference.hpp"
#include "narrow.hpp"
#include "outline.hpp"

namespace mobee::narrow {

namespace cylinder {

constexpr double infinity = std::numeric_limits<double>::infinity();

// The difference of a solid made of segments along its own axes (a box, or the core of a capsule) and of a cylinder, in the axes of
// the first.  Its shortest way out is along the cylinder's axis c, across c and a segment, along an axis of a box, or a smooth minimum
// among the directions square to c or to a segment.  (Where the cylinder's rim meets a corner, the reach has no minimum.)
struct Swept {
    Vec3 shift;  // from the cylinder's centre to that of the other
    Vec3 half;   // of the segments
    Vec3 axis;   // c
    double radius, height;

    double reach(Vec3 n) const {
        const Vec3 around = cross(n, axis);
        return dot(n, shift) + dot(half, absolute(n)) + height * std::fabs(dot(n, axis)) + radius * length(around);
    }
};

// The shorter of the two ways along a unit vector, if it is shorter than what there is.
void improve(Way& best, const Swept& swept, Vec3 axis) {
    const Vec3 n = sign(-dot(axis, swept.shift)) * axis;
    const double reach = swept.reach(n);
    if (reach < best.reach - tie) best = {reach, n};
}

// Along c, and across c and a segment.
Way across_faces(const Swept& swept, bool box) {
    const Vec3 c = swept.axis;
    Way best = {infinity, {}};
    improve(best, swept, c);
    for (int i = 2; i < 5; ++i) {
        Vec3 e;
        e[i % 3] = 1.0;
        if (box) improve(best, swept, e);
    }
    for (int i = 0; i < 3; ++i) {
        if (!box && swept.half[i] == 0.0) continue;
        Vec3 e;
        e[i] = 1.0;
        const Vec3 n = cross(e, c);
        const double size = length(n);
        if (size > flat) improve(best, swept, over(n, size));
    }
    return best;
}

// Square to c: away from the corner of the segments' outline that is closest to c.
void away_from_corner(Way& best, const Swept& swept) {
    const Vec3 c = swept.axis, shift = swept.shift - dot(swept.shift, c) * c;
    double nearest = infinity;
    Vec3 corner;
    for (int k = 0; k < 4; ++k) {
        for (const double z : {swept.half.z, -swept.half.z}) {
            const Vec3 p = {k & 1 ? swept.half.x : -swept.half.x, k & 2 ? swept.half.y : -swept.half.y, z};
            const Vec3 q = shift + p - dot(p, c) * c;
            if (dot(q, q) < nearest) corner = q, nearest = dot(q, q);
        }
    }
    const double size = std::sqrt(nearest);
    if (size > touching) improve(best, swept, over(corner, size));
}

// Square to the segment along axis i.
void around_segment(Way& best, const Swept& swept, int i) {
    const int j = (i + 1) % 3, k = (i + 2) % 3;
    const Vec3 c = swept.axis;
    const Disc disc = {swept.radius, {-c[k], c[j]}, c[i] * c[i], 0.0};
    if (disc.lean <= flat * flat) return;
    const Point shift = {swept.shift[j], swept.shift[k]}, across = {c[j], c[k]};
    Point kink[6], swell[6];
    int kinks = 0;
    const double size = std::sqrt(dot(across, across));
    const bool leans = size > flat;
    const bool down = disc.beside.y < 0.0 || (disc.beside.y == 0.0 && disc.beside.x < 0.0);
    const Point beside = ((down ? -1.0 : 1.0) / (leans ? size : 1.0)) * disc.beside;
    kink[kinks++] = {1.0, 0.0};
    if (leans && beside.x > 0.0) kink[kinks++] = beside;
    kink[kinks++] = {0.0, 1.0};
    if (leans && !(beside.x > 0.0)) kink[kinks++] = beside;
    for (int m = 0; m < kinks; ++m) {
        swell[m] = bulge(disc, kink[m]);
        kink[kinks + m] = -kink[m];
        swell[kinks + m] = -swell[m];
    }
    Exit exit = {best.reach, {}};
    for (int m = 0; m < 2 * kinks; ++m) {
        const int next = m + 1 < 2 * kinks ? m + 1 : 0;
        const Point from = kink[m], to = kink[next], middle = from + to;
        // The opposite ones are shorter.
        if (dot(shift, from) > 0.0 && dot(shift, to) > 0.0) continue;
        const Point segments = {std::copysign(swept.half[j], middle.x), std::copysign(swept.half[k], middle.y)};
        const Point corner = shift + segments + std::copysign(swept.height, dot(middle, across)) * across;
        const Point first = corner + swell[m], chord = swell[next] - swell[m];
        const double limit = exit.reach - tie, apart = cross(first, chord);
        if (apart > 0.0 && apart * apart >= limit * limit * dot(chord, chord)) continue;
        improve_between(disc, corner, from, to, exit);
    }
    if (!(exit.reach < best.reach)) return;
    best.reach = exit.reach;
    best.direction[i] = 0.0;
    best.direction[j] = exit.n.x;
    best.direction[k] = exit.n.y;
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

namespace cylinder {

bool holds_point(const Volume& v, Vec3 point) {
    const Vec3 p = into(v.rotation, point - v.center);
    if (v.kind == Kind::box) return std::fabs(p.x) < v.half.x && std::fabs(p.y) < v.half.y && std::fabs(p.z) < v.half.z;
    return p.x * p.x + p.y * p.y < v.half.x * v.half.x && std::fabs(p.z) < v.half.y;
}

}  // namespace cylinder

double cylinder_box(const Volume& a, const Volume& b, Touch& touch) {
    const cylinder::Swept swept = {into(b.rotation, b.center - a.center), b.half, into(b.rotation, a.rotation.column(2)), a.half.x, a.half.y};
    Way best = cylinder::across_faces(swept, true);
    if (best.reach <= 0.0) return best.reach;
    cylinder::away_from_corner(best, swept);
    for (int i = 0; i < 3; ++i) cylinder::around_segment(best, swept, i);
    if (best.reach <= 0.0) return best.reach;
    const Touch found = touch_along(a, b, out_of(b.rotation, best.direction), best.reach);
    if (!(cylinder::holds_point(a, found.point) && cylinder::holds_point(b, found.point))) {
        // No point is known yet to be in both.
        Difference difference(a, b);
        const double apart = closest(difference, 0.0).distance;
        if (apart > 0.0) return -apart;
    }
    touch = found;
    return best.reach;
}

}  // namespace mobee::narrow
