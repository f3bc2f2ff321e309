// SPDX-License-Identifier: Apache-2.0
// Spheres and capsules with boxes: a point or a segment c + s h, |s| <= 1, inflated by a radius, in the box's axes.
#include "lanes.hpp"
#include "narrow.hpp"

namespace mobee::narrow {

namespace rounded_box {

constexpr double far = 2.0;  // a parameter beyond every segment's end

struct Span {
    double low, high;
};

// The interval of s in which the coordinate x + s h is within [-k, k]; all s if the line is parallel to these faces.
inline Span span_within(double x, double h, double k, double least_square) {
    if (h * h <= least_square) return {-far, far};
    const double middle = -x / h, reach = std::fabs(k / h);
    return {middle - reach, middle + reach};
}

inline double outer(double s, Span span) { return most(s - span.high, 0.0) - most(span.low - s, 0.0); }

// The same along all three axes at once; the fourth numbers are those of a parallel line.
struct Spans {
    Four low, high;
};

inline Spans spans_within(Four c, Four h, Four k, double least_square) {
    const Four middle = -c / h, reach = absolute_of(k / h);
    const auto parallel = h * h <= least_square;
    return {parallel ? Four{} - far : middle - reach, parallel ? Four{} + far : middle + reach};
}

// Half the derivative of the squared distance at four points of the segment.  It never decreases, and is linear between the ends of the
// spans.
inline Four slopes(Four s, const Spans& spans, Four weight) {
    const Four none{};
    Four slope{};
    for (int axis = 0; axis < 3; ++axis)
        slope += weight[axis] * (most_of(s - spans.high[axis], none) - most_of(spans.low[axis] - s, none));
    return slope;
}

inline double most_of_three(Four v) { return most(most(v[0], v[1]), v[2]); }
inline double least_of_three(Four v) { return least(least(v[0], v[1]), v[2]); }

// The s at which the segment is closest to the box of half edges k about the origin; the middle of all such s.
double closest_to_box(Vec3 center, Vec3 half_core, Vec3 half) {
    const Four c = four(center), h = four(half_core), k = four(half);
    const Spans spans = spans_within(c, h, k, flat * flat * dot(half_core, half_core));
    const double low = most(most_of_three(spans.low), -1.0), high = least(least_of_three(spans.high), 1.0);
    if (low <= high) return (low + high) / 2.0;
    // The slope changes its sign between the last knot at which it is not above 0 and the first at which it is not below 0.
    const Four weight = h * h, none{};
    const Four a = unit_of(Four{-1.0, spans.low[0], spans.low[1], spans.low[2]}), b = unit_of(Four{1.0, spans.high[0], spans.high[1], spans.high[2]});
    const Four at_a = slopes(a, spans, weight), at_b = slopes(b, spans, weight);
    const Four last = most_of(at_a <= none ? a : none - 1.0, at_b <= none ? b : none - 1.0);
    const Four first = least_of(at_a >= none ? a : none + 1.0, at_b >= none ? b : none + 1.0);
    const double left = most(most_of_three(last), last[3]), right = least(least_of_three(first), first[3]);
    if (left >= right) return right;
    const Four ends = slopes(Four{left, right, left, right}, spans, weight);
    return left + (right - left) * (ends[0] / (ends[0] - ends[1]));
}

inline double beyond(double x, double k) { return x - clamp(x, -k, k); }
inline Vec3 beyond(Vec3 p, Vec3 k) { return {beyond(p.x, k.x), beyond(p.y, k.y), beyond(p.z, k.z)}; }

// A contact given in the box's own axes.
Touch from_box(const Volume& box, Vec3 normal, Vec3 point) {
    return {out_of(box.rotation, normal), box.center + out_of(box.rotation, point)};
}

// The contact of a point p of the core that is outside the box, at d from the nearest point of it.
double outside(const Volume& a, const Volume& box, Vec3 p, Vec3 d, double apart, Touch& touch) {
    const Vec3 normal = over(d, apart);
    touch = from_box(box, normal, p - 0.5 * (a.radius + apart) * normal);
    return a.radius - apart;
}

// A separation from the box, or from the box swept along the core: through a face, or along the cross product of the core and an edge.
struct Exit {
    double sink = 0.0;
    Vec3 normal;
    int edge = -1;
};

void try_face(Exit& exit, double c, double a, double k, int axis) {
    const double turn = sign(c), sink = k + a - turn * c;
    if (axis > 0 && !(sink < exit.sink - tie)) return;
    exit = {sink, {}, -1};
    exit.normal[axis] = turn;
}

void try_edge(Exit& exit, Vec3 c, Vec3 h, Vec3 k, int axis, double least_square) {
    const int one = axis == 2 ? 0 : axis + 1, two = axis == 0 ? 2 : axis - 1;
    const double square = h[one] * h[one] + h[two] * h[two];
    if (!(square > least_square)) return;
    const double length = std::sqrt(square), off = (c[two] * h[one] - c[one] * h[two]) / length, turn = sign(off);
    const double sink = (k[one] * std::fabs(h[two]) + k[two] * std::fabs(h[one])) / length - turn * off;
    if (!(sink < exit.sink - tie)) return;
    exit = {sink, {}, axis};
    exit.normal[one] = -turn * h[two] / length;
    exit.normal[two] = turn * h[one] / length;
}

// The deepest point of the core along the separation from the box: an end, or a point above the middle of the overlap.
double deepest(Vec3 c, Vec3 h, Vec3 k, const Exit& exit, double least_square) {
    const Vec3 n = exit.normal;
    if (exit.edge >= 0) {
        // Moved out by normal * sink, the core crosses the box's edge.
        Vec3 across = h;
        across[exit.edge] = 0.0;
        const Vec3 corner = {std::copysign(k.x, n.x), std::copysign(k.y, n.y), std::copysign(k.z, n.z)};
        return unit(dot(across, corner - c - exit.sink * n) / dot(across, across));
    }
    const double slope = dot(n, h);
    if (slope * slope > least_square) return slope > 0.0 ? -1.0 : 1.0;
    const Span x = span_within(c.x, h.x, k.x, least_square), y = span_within(c.y, h.y, k.y, least_square),
               z = span_within(c.z, h.z, k.z, least_square);
    return unit((most(most(x.low, y.low), most(z.low, -1.0)) + least(least(x.high, y.high), least(z.high, 1.0))) / 2.0);
}

// The contact of a core that overlaps the box.
double pierced(const Volume& a, const Volume& box, Vec3 c, Vec3 h, Touch& touch) {
    const Vec3 k = box.half, reach = absolute(h);
    const double least_square = flat * flat * dot(h, h);
    Exit exit;
    for (int axis = 0; axis < 3; ++axis) try_face(exit, c[axis], reach[axis], k[axis], axis);
    for (int axis = 0; axis < 3; ++axis) try_edge(exit, c, h, k, axis, least_square);
    const double s = deepest(c, h, k, exit, least_square);
    touch = from_box(box, exit.normal, c + s * h - 0.5 * (a.radius - exit.sink) * exit.normal);
    return a.radius + exit.sink;
}

}  // namespace rounded_box

double sphere_box(const Volume& a, const Volume& b, Touch& touch) {
    const Vec3 c = into(b.rotation, a.center - b.center), d = rounded_box::beyond(c, b.half);
    const double squared = dot(d, d);
    if (squared >= a.radius * a.radius) return a.radius - std::sqrt(squared);
    if (squared > touching * touching) return rounded_box::outside(a, b, c, d, std::sqrt(squared), touch);
    return rounded_box::pierced(a, b, c, Vec3{}, touch);
}

double capsule_box(const Volume& a, const Volume& b, Touch& touch) {
    const Vec3 c = into(b.rotation, a.center - b.center), h = into(b.rotation, a.core);
    const Vec3 p = c + rounded_box::closest_to_box(c, h, b.half) * h, d = rounded_box::beyond(p, b.half);
    const double squared = dot(d, d);
    if (squared >= a.radius * a.radius) return a.radius - std::sqrt(squared);
    if (squared > touching * touching) return rounded_box::outside(a, b, p, d, std::sqrt(squared), touch);
    return rounded_box::pierced(a, b, c, h, touch);
}

double capsule_box_distance(const Volume& a, const Volume& b) {
    const Vec3 c = into(b.rotation, a.center - b.center), h = into(b.rotation, a.core);
    const Vec3 p = c + rounded_box::closest_to_box(c, h, b.half) * h;
    return most(length(rounded_box::beyond(p, b.half)) - a.radius, 0.0);
}

}  // namespace mobee::narrow
