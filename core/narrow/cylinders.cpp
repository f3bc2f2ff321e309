// SPDX-License-Identifier: Apache-2.0
// Two cylinders.
//
// Their difference is two discs and two segments.  Its smallest separation is along an axis, across both axes, a smooth minimum among the
// directions perpendicular to one axis, or the smallest distance of a rim of one from a rim of the other.
#include <bit>
#include <limits>

#include "difference.hpp"
#include "lanes.hpp"
#include "narrow.hpp"
#include "outline.hpp"

namespace mobee::narrow {

namespace cylinders {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Replace the best separation by the one along an axis, or against it, if that is smaller.
inline void prefer(Separation& best, Vec3 n, double extent, double shift) {
    const double reach = extent + away(shift) * shift;
    if (reach < best.reach - tie) best = {reach, away(shift) * n};
}

// A function, because g++ 12 may fuse a product into a sum (one rounding) in spite of -ffp-contract=off.
[[gnu::noinline]] Point times(double s, Point v) { return s * v; }

// Perpendicular to the axis of `around`, which is z; `axis` and `shift`: of the other cylinder, in the frame of `around`.
bool prefer_square_to(Separation& best, const Volume& around, const Volume& other, Vec3 axis, Vec3 shift) {
    const Point across = {axis.x, axis.y};
    Exit exit = {best.reach, {}};
    if (std::fabs(axis.z) > flat) {
        improve_around({other.half.x, across, other.half.y * across, axis.z * axis.z, around.half.x}, {shift.x, shift.y}, {0.0, 0.0}, exit);
    } else {
        // The other cylinder is seen from the side, as a rectangle along its axis and across it.
        const Disc none = {0.0, {0.0, 0.0}, {0.0, 0.0}, 1.0, around.half.x};
        const Point turned = times(shift.x, {across.x, -across.y}) + times(shift.y, {across.y, across.x});
        improve_around(none, turned, {other.half.y, other.half.x}, exit);
        exit.n = times(exit.n.x, across) + times(exit.n.y, {-across.y, across.x});
    }
    if (!(exit.reach < best.reach)) return false;
    best = {exit.reach, {exit.n.x, exit.n.y, 0.0}};
    return true;
}

// The reach of a cylinder from its centre along a vector, times the vector's length.
inline double reach(const Volume& v, Vec3 n) {
    const Vec3 axis = v.rotation.column(2);
    return v.half.y * std::fabs(dot(n, axis)) + v.half.x * length(cross(n, axis));
}

// The overlap along the direction in which the two axes are closest, which separates nearly all separate cylinders.
double across_axes(const Volume& a, const Volume& b) {
    const Vec3 w = a.center - b.center;
    const auto [s, t] = closest_parameters(w, a.core, b.core);
    const Vec3 n = w + s * a.core - t * b.core;
    const double size = length(n);
    return size > touching ? (reach(a, n) + reach(b, n) - dot(n, w)) / size : infinity;
}

}  // namespace cylinders

// Where the smallest separation is smooth, from a point of one rim to a point of another, their distance is a local minimum of that of
// two circles: the second derivatives of the reach and of the distance have the same sign there.
namespace rims {

constexpr int most_steps = 60, most_arcs = 32;

// In the axes of the first cylinder, whose own axis is z.
struct Pair {
    Vec3 shift, axis;  // of the second
    double radius, height, other_radius, other_height;
    double sine;  // of the angle between the axes

    double reach(Vec3 n) const {
        return dot(n, shift) + height * std::fabs(n.z) + radius * std::sqrt(n.x * n.x + n.y * n.y) + other_height * std::fabs(dot(n, axis)) +
               other_radius * length(cross(n, axis));
    }
};

// A circle about the z axis, and another one: its middle, and two of its radii, the second of which is horizontal; the direction out of the
// other cylinder's end, and the horizontal part of that direction.
struct Circles {
    double radius, height, other_radius;
    Vec3 middle, rising, level, out_of_end;
    double sine;
};

// A point of the other circle and the nearest point of the first.
struct Near {
    Vec3 to_point;     // from the nearest point to the point
    Vec3 across;  // perpendicular to both circles
    double side, distance;
    double slope, bend;  // first and second derivative of half the squared distance

    Near(const Circles& circles, Point at) {
        const Vec3 outwards = at.x * circles.rising + at.y * circles.level, along = at.x * circles.level - at.y * circles.rising;
        const Vec3 p = circles.middle + outwards;
        side = std::sqrt(p.x * p.x + p.y * p.y);
        const Vec3 radial = side > 0.0 ? Vec3{p.x / side, p.y / side, 0.0} : Vec3{1.0, 0.0, 0.0}, round = {-radial.y, radial.x, 0.0};
        to_point = p - circles.radius * radial - Vec3{0.0, 0.0, circles.height};
        across = cross(round, along);
        distance = length(to_point);
        slope = dot(to_point, along);
        const double turning = dot(along, round);
        bend = dot(along, along) - circles.radius / side * turning * turning - dot(to_point, outwards);
    }
};

struct Arc {
    Point from, to;
};

inline Point normalized(Point v) { return (1.0 / std::sqrt(dot(v, v))) * v; }

// The minimum within an angle of a point, where the slope increases everywhere; false if there is none.
bool descend(const Circles& circles, Point start, double angle, Near& found) {
    // The point at x is start + x aside, normalised.
    const Point aside = {-start.y, start.x};
    const double end = std::tan(least(1.01 * angle, 1.5));
    double low = -end, high = end, x = 0.0;
    for (int step = 0; step < 40; ++step) {
        (found.slope > 0.0 ? high : low) = x;
        const double turn = found.bend > 0.0 ? -found.slope / found.bend : found.slope > 0.0 ? -1.0 : 1.0;
        if (std::fabs(turn) < 1e-12) return true;
        if ((x == end && found.slope < 0.0) || (x == -end && found.slope > 0.0)) return false;
        double next = x + turn * (1.0 + x * x);
        if (!(next > low)) next = low == -end ? low : 0.5 * (low + high);
        if (!(next < high)) next = high == end ? high : 0.5 * (low + high);
        if (next == x) return true;
        x = next;
        found = Near(circles, normalized(start + x * aside));
    }
    return true;
}

void prefer(Separation& best, const Pair& pair, const Near& near, double up) {
    Vec3 n = near.distance > touching ? near.to_point : near.across;
    n = (1.0 / length(n)) * n;
    n.z *= up;
    for (const double turn : {1.0, -1.0}) {
        const double reach = pair.reach(turn * n);
        if (reach < best.reach - tie) best = {reach, turn * n};
    }
}

// Four vectors: three registers of four numbers.
struct FourVectors {
    Four x, y, z;
};

inline FourVectors operator+(FourVectors a, FourVectors b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline FourVectors operator-(FourVectors a, FourVectors b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline FourVectors operator*(Four s, Vec3 v) { return {s * v.x, s * v.y, s * v.z}; }
inline Four dot(FourVectors a, FourVectors b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

// Four arcs: the directions of their middles, and a bound of the distance of their ends from these.
struct FourArcs {
    Four from_x, from_y, to_x, to_y;
    Four middle_x, middle_y, angle;

    explicit FourArcs(const Arc* arcs)
        : from_x(load<Four>(&arcs[0])), from_y(load<Four>(&arcs[1])), to_x(load<Four>(&arcs[2])), to_y(load<Four>(&arcs[3])) {
        transpose(from_x, from_y, to_x, to_y);
        const Four chord_x = to_x - from_x, chord_y = to_y - from_y, size = root_of(chord_x * chord_x + chord_y * chord_y), half = 0.5 * size;
        middle_x = chord_y / size;
        middle_y = -chord_x / size;
        angle = half * (1.0 + 0.58 * half * half);  // above the inverse of its sine
    }
    Point middle(int which) const { return {middle_x[which], middle_y[which]}; }
    Arc first_half(int which) const { return {{from_x[which], from_y[which]}, middle(which)}; }
    Arc second_half(int which) const { return {middle(which), {to_x[which], to_y[which]}}; }
};

// For four arcs, bit by bit: whether an arc may contain a smallest separation, and whether it contains one at most.
struct Minima {
    unsigned perhaps, at_most_one;
};

// Decide from the middles of four arcs whether separations smaller than a limit can start on the arcs.
//
// The derivatives of half the squared distance that are not known at a middle are bounded: `side` by its least value, `turning` by the
// radius, and the product of `turning` and its derivative by half of the square.  A separation leads out of both volumes.
Minima minima_on(const Circles& circles, const FourArcs& arcs, double limit) {
    const FourVectors out_of_axis = arcs.middle_x * circles.rising + arcs.middle_y * circles.level;
    const FourVectors along = arcs.middle_x * circles.level - arcs.middle_y * circles.rising;
    const FourVectors p = Four{1.0, 1.0, 1.0, 1.0} * circles.middle + out_of_axis;
    const Four none{}, p_side = root_of(p.x * p.x + p.y * p.y), x = p.x / p_side, y = p.y / p_side;
    const FourVectors to_point = {p.x - circles.radius * x, p.y - circles.radius * y, p.z - circles.height};
    const Four distance = root_of(dot(to_point, to_point)), out = dot(to_point, out_of_axis);
    const Four beyond = to_point.x * circles.out_of_end.x + to_point.y * circles.out_of_end.y + to_point.z * circles.out_of_end.z;
    const Four slope = absolute_of(dot(to_point, along)), turning = along.y * x - along.x * y;
    const Four bend = dot(along, along) - circles.radius / p_side * turning * turning - out;

    const double other = circles.other_radius, square = other * other;
    const Four angle = arcs.angle, far = other * angle, side = p_side - far, far_off = other * (distance + far);
    const Four tight = circles.radius / side;
    const Four change = angle * (tight * square * (1.5 + 1.155 * other / side) + far_off);
    const Four least_square = distance * distance - angle * (2.0 * slope + angle * most_of(change - bend, none));
    unsigned ruled_out = less(angle * (square * most_of(tight - 1.0, none + 1.0) + far_off), slope);
    ruled_out |= less(out + angle * (0.5 * square * tight + far_off), none);
    ruled_out |= less(beyond + angle * tight * (other * circles.sine), none);
    ruled_out |= less(bend + change, none) | less(angle * (absolute_of(bend) + 0.5 * change), slope);
    ruled_out |= less(none + limit * limit, least_square);
    ruled_out &= less(none, side);
    ruled_out |= less(none + limit, distance - far) | less(none + circles.radius, side);
    const unsigned at_most_one = less(change, bend) & less(none, side) & ~ruled_out;
    return {~ruled_out & ~at_most_one & 0xfu, at_most_one};
}

// Search the arcs of the other circle that are below the first; false if there are too many.
bool prefer_along(Separation& best, const Pair& pair, const Circles& circles, double up) {
    const double rise = circles.rising.z, above = circles.height - circles.middle.z;
    const double high = clamp(above / rise, -1.0, 1.0), low = clamp((above - best.reach) / rise, -1.0, 1.0);
    if (!(low < high)) return true;
    const Point from = {high, std::sqrt(1.0 - high * high)}, to = {low, std::sqrt(1.0 - low * low)};
    const Point middle = normalized({to.y - from.y, high - low});
    const auto mirrored = [](Point point) { return Point{point.x, -point.y}; };
    Arc stack[most_arcs] = {{from, middle}, {middle, to}, {mirrored(to), mirrored(middle)}, {mirrored(middle), mirrored(from)}};
    int waiting = 4;
    for (int step = 0; step < most_steps; ++step) {
        if (waiting == 0) return true;
        const int taken = waiting < 4 ? waiting : 4;
        waiting -= taken;
        const FourArcs arcs(stack + waiting);
        const unsigned all = (1u << taken) - 1u;
        const auto [perhaps, at_most_one] = minima_on(circles, arcs, best.reach - tie);
        for (unsigned left = at_most_one & all; left != 0; left &= left - 1) {
            const int which = std::countr_zero(left);
            Near near(circles, arcs.middle(which));
            if (descend(circles, arcs.middle(which), arcs.angle[which], near)) prefer(best, pair, near, up);
        }
        if (waiting + 8 > most_arcs) return false;
        for (unsigned left = perhaps & all; left != 0; left &= left - 1) {
            const int which = std::countr_zero(left);
            stack[waiting++] = arcs.first_half(which);
            stack[waiting++] = arcs.second_half(which);
        }
    }
    return false;
}

// Return whether all separations from rim to rim have been tried.
bool prefer_where_they_meet(Separation& best, const Pair& pair) {
    for (const double up : {1.0, -1.0}) {
        // Rotated so that the first cylinder's rim is the upper one.
        const Vec3 axis = {pair.axis.x, pair.axis.y, up * pair.axis.z}, shift = {pair.shift.x, pair.shift.y, up * pair.shift.z};
        const Vec3 rising = (1.0 / pair.sine) * (Vec3{0.0, 0.0, 1.0} - axis.z * axis), level = cross(axis, rising);
        for (const double turn : {1.0, -1.0}) {
            const Vec3 middle = shift + turn * pair.other_height * axis;
            // The first cylinder's rim must also be below the other's end, by less than the smallest separation.
            const double off = turn * dot(Vec3{0.0, 0.0, pair.height} - shift, axis), swing = pair.radius * pair.sine;
            if (off - swing > pair.other_height || off + swing < pair.other_height - best.reach) continue;
            const double other = pair.other_radius;
            const Circles circles = {pair.radius, pair.height, other, middle, other * rising, other * level, turn * axis, pair.sine};
            if (!prefer_along(best, pair, circles, up)) return false;
        }
    }
    return true;
}

}  // namespace rims

double cylinder_cylinder(const Volume& a, const Volume& b, Touch& touch) {
    using namespace cylinders;
    const double between = across_axes(a, b);
    if (between <= 0.0) return between;
    const Vec3 d = into(a.rotation, b.center - a.center), c = into(a.rotation, b.rotation.column(2));
    const double cosine = std::fabs(c.z), sine = std::sqrt(c.x * c.x + c.y * c.y), off = dot(d, c);
    const double first = a.half.y + b.half.y * cosine + b.half.x * sine, second = b.half.y + a.half.y * cosine + a.half.x * sine;
    const bool leans = sine > flat;
    const Vec3 square = (leans ? 1.0 / sine : 0.0) * Vec3{-c.y, c.x, 0.0};
    const double across = leans ? a.half.x + b.half.x : infinity, aside = dot(d, square);
    const double apart = least(least(first - std::fabs(d.z), second - std::fabs(off)), across - std::fabs(aside));
    if (apart <= 0.0) return apart;
    Separation best = {infinity, {}};
    prefer(best, {0.0, 0.0, 1.0}, first, d.z);
    prefer(best, c, second, off);
    prefer(best, square, across, aside);
    prefer_square_to(best, a, b, c, d);
    const Vec3 axis = into(b.rotation, a.rotation.column(2)), shift = into(b.rotation, b.center - a.center);
    if (prefer_square_to(best, b, a, axis, shift)) best.direction = into(a.rotation, out_of(b.rotation, best.direction));
    if (best.reach <= 0.0) return best.reach;
    Touch found = touch_along(a, b, out_of(a.rotation, best.direction), best.reach);
    const double known = best.reach, bound = separation_bound(a, b, found, known);
    if (bound >= known - tie) {
        touch = found;
        return known;
    }
    Difference difference(a, b);
    const double gap = bound > 0.0 || known_to_meet(a, b, found.point) ? 0.0 : difference.apart();
    if (gap > 0.0) return -gap;
    if (leans && !rims::prefer_where_they_meet(best, {d, c, a.half.x, a.half.y, b.half.x, b.half.y, sine})) best = least_separation(difference, best);
    if (best.reach < known) found = touch_along(a, b, out_of(a.rotation, best.direction), best.reach);
    touch = found;
    return best.reach;
}

}  // namespace mobee::narrow
