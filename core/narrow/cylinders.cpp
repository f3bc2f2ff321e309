// Two cylinders.
//
// Their difference is two discs and two segments.  Its shortest way out is along an axis, across both axes, a smooth minimum among the
// directions square to one axis, or the least distance of a rim of one from a rim of the other.
#include <limits>

#include "difference.hpp"
#include "narrow.hpp"
#include "outline.hpp"

namespace mobee::narrow {

namespace cylinders {

constexpr double infinity = std::numeric_limits<double>::infinity();

// Take the way along an axis, or against it, whichever leads apart sooner.
inline void prefer(Way& best, Vec3 n, double extent, double shift) {
    const double reach = extent + away(shift) * shift;
    if (reach < best.reach - tie) best = {reach, away(shift) * n};
}

// A call, for as part of a sum g++ 12 may round product and sum as one, in spite of -ffp-contract=off.
[[gnu::noinline]] Point times(double s, Point v) { return s * v; }

// Square to the z axis, which is that of `around`; the other's axis and how far it is away are seen from there.
bool prefer_square_to(Way& best, const Volume& around, const Volume& other, Vec3 axis, Vec3 shift) {
    const Point across = {axis.x, axis.y};
    Exit exit = {best.reach, {}};
    if (std::fabs(axis.z) > flat) {
        improve_around({other.half.x, across, other.half.y * across, axis.z * axis.z, around.half.x}, {shift.x, shift.y}, {0.0, 0.0}, exit);
    } else {
        // The other is seen from the side: a rectangle, along the axis and across it.
        const Disc none = {0.0, {0.0, 0.0}, {0.0, 0.0}, 1.0, around.half.x};
        const Point turned = times(shift.x, {across.x, -across.y}) + times(shift.y, {across.y, across.x});
        improve_around(none, turned, {other.half.y, other.half.x}, exit);
        exit.n = times(exit.n.x, across) + times(exit.n.y, {-across.y, across.x});
    }
    if (!(exit.reach < best.reach)) return false;
    best = {exit.reach, {exit.n.x, exit.n.y, 0.0}};
    return true;
}

// How far a cylinder reaches along a vector, times its length, from its centre.
inline double reach(const Volume& v, Vec3 n) {
    const Vec3 axis = v.rotation.column(2);
    return v.half.y * std::fabs(dot(n, axis)) + v.half.x * length(cross(n, axis));
}

// The overlap along the direction in which the two axes are closest; nearly all that are apart are so along it.
double across_axes(const Volume& a, const Volume& b) {
    const Vec3 w = a.center - b.center;
    const auto [s, t] = closest_parameters(w, a.core, b.core);
    const Vec3 n = w + s * a.core - t * b.core;
    const double size = length(n);
    return size > touching ? (reach(a, n) + reach(b, n) - dot(n, w)) / size : infinity;
}

}  // namespace cylinders

// Where the shortest way out is smooth, from a point of one rim to a point of another, their distance is a local minimum of that of
// two circles: the second derivatives of the reach and of the distance have the same sign there.
namespace rims {

constexpr int most_steps = 60, most_arcs = 16;

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

// A circle about the z axis and another: its middle, and two radii of it, of which the second is level; which way is out of the other's
// end, and how much of that is level.
struct Circles {
    double radius, height, other_radius;
    Vec3 middle, rising, level, out_of_end;
    double sine;
};

// A point of the other circle and what is nearest on the first.
struct Near {
    Vec3 way;     // from there
    Vec3 across;  // both circles
    double side, distance;
    double out, beyond;  // the way, along the radius there and out of the other's end
    double slope, bend;  // first and second derivative of half the squared distance

    Near(const Circles& circles, Point at) {
        const Vec3 outwards = at.x * circles.rising + at.y * circles.level, along = at.x * circles.level - at.y * circles.rising;
        const Vec3 p = circles.middle + outwards;
        side = std::sqrt(p.x * p.x + p.y * p.y);
        const Vec3 radial = side > 0.0 ? Vec3{p.x / side, p.y / side, 0.0} : Vec3{1.0, 0.0, 0.0}, round = {-radial.y, radial.x, 0.0};
        way = p - circles.radius * radial - Vec3{0.0, 0.0, circles.height};
        across = cross(round, along);
        distance = length(way);
        out = dot(way, outwards);
        beyond = dot(way, circles.out_of_end);
        slope = dot(way, along);
        const double turning = dot(along, round);
        bend = dot(along, along) - circles.radius / side * turning * turning - out;
    }
};

struct Arc {
    Point from, to;
};

inline Point normalized(Point v) { return (1.0 / std::sqrt(dot(v, v))) * v; }

// The minimum within an angle of a point, where the slope rises all along; false if there is none.
bool descend(const Circles& circles, Point start, double angle, Near& found) {
    // The point at x is start + x aside, made a unit.
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

void prefer(Way& best, const Pair& pair, const Near& near, double up) {
    Vec3 n = near.distance > touching ? near.way : near.across;
    n = (1.0 / length(n)) * n;
    n.z *= up;
    for (const double turn : {1.0, -1.0}) {
        const double reach = pair.reach(turn * n);
        if (reach < best.reach - tie) best = {reach, turn * n};
    }
}

enum class Minimum { none, perhaps, at_most_one };

// What the middle of an arc tells of the shortest ways, shorter than a limit, that start there; no end is farther than `angle` from it.
//
// Of half the squared distance, derivatives that the middle does not tell are bounded: side >= the least there is, turning by the
// radius, and the product of turning and its derivative by half of the square.  A way out leads out of both volumes.
Minimum shortest_on_arc(const Circles& circles, const Near& middle, double angle, double limit) {
    const double other = circles.other_radius, far = other * angle, side = middle.side - far;
    if (middle.distance - far >= limit || side >= circles.radius) return Minimum::none;
    if (side <= 0.0) return Minimum::perhaps;
    const double tight = circles.radius / side, square = other * other, far_off = other * (middle.distance + far);
    const double slope = std::fabs(middle.slope);
    if (slope > angle * (square * most(1.0, tight - 1.0) + far_off)) return Minimum::none;
    if (middle.out < -angle * (0.5 * tight * square + far_off)) return Minimum::none;
    if (middle.beyond < -angle * tight * other * circles.sine) return Minimum::none;
    const double change = angle * (tight * square * (1.5 + 1.155 * other / side) + far_off);
    if (middle.bend < -change || slope > angle * (std::fabs(middle.bend) + 0.5 * change)) return Minimum::none;
    const double least_square = middle.distance * middle.distance - angle * (2.0 * slope + angle * most(change - middle.bend, 0.0));
    if (least_square >= limit * limit) return Minimum::none;
    return middle.bend > change ? Minimum::at_most_one : Minimum::perhaps;
}

// Of the arcs of the other circle that are below the first; false if they are too many.
bool prefer_along(Way& best, const Pair& pair, const Circles& circles, double up) {
    const double rise = circles.rising.z, above = circles.height - circles.middle.z;
    const double high = clamp(above / rise, -1.0, 1.0), low = clamp((above - best.reach) / rise, -1.0, 1.0);
    if (!(low < high)) return true;
    const double beside_high = std::sqrt(1.0 - high * high), beside_low = std::sqrt(1.0 - low * low);
    Arc stack[most_arcs] = {{{high, beside_high}, {low, beside_low}}, {{low, -beside_low}, {high, -beside_high}}};
    int waiting = 2;
    for (int step = 0; step < most_steps; ++step) {
        if (waiting == 0) return true;
        const Arc arc = stack[--waiting];
        const Point chord = arc.to - arc.from, middle = normalized({chord.y, -chord.x});
        const double half = 0.5 * std::sqrt(dot(chord, chord)), angle = half * (1.0 + 0.58 * half * half);  // above its sine's inverse
        Near near(circles, middle);
        const Minimum found = shortest_on_arc(circles, near, angle, best.reach - tie);
        if (found == Minimum::at_most_one && descend(circles, middle, angle, near)) prefer(best, pair, near, up);
        if (found != Minimum::perhaps) continue;
        if (waiting + 2 > most_arcs) return false;
        stack[waiting++] = {arc.from, middle};
        stack[waiting++] = {middle, arc.to};
    }
    return false;
}

// Whether all ways from rim to rim have been tried.
bool prefer_where_they_meet(Way& best, const Pair& pair) {
    for (const double up : {1.0, -1.0}) {
        // Turned so that the first's rim is the upper one.
        const Vec3 axis = {pair.axis.x, pair.axis.y, up * pair.axis.z}, shift = {pair.shift.x, pair.shift.y, up * pair.shift.z};
        const Vec3 rising = (1.0 / pair.sine) * (Vec3{0.0, 0.0, 1.0} - axis.z * axis), level = cross(axis, rising);
        for (const double turn : {1.0, -1.0}) {
            const Vec3 middle = shift + turn * pair.other_height * axis;
            // The first's rim must come below the other's end, too, by less than the shortest way.
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
    Way best = {infinity, {}};
    prefer(best, {0.0, 0.0, 1.0}, first, d.z);
    prefer(best, c, second, off);
    prefer(best, square, across, aside);
    prefer_square_to(best, a, b, c, d);
    const Vec3 axis = into(b.rotation, a.rotation.column(2)), shift = into(b.rotation, b.center - a.center);
    if (prefer_square_to(best, b, a, axis, shift)) best.direction = into(a.rotation, out_of(b.rotation, best.direction));
    if (best.reach <= 0.0) return best.reach;
    Touch found = touch_along(a, b, out_of(a.rotation, best.direction), best.reach);
    const double known = best.reach, bound = least_way_out(a, b, found, known);
    if (bound >= known - tie) {
        touch = found;
        return known;
    }
    Difference difference(a, b);
    const double gap = bound > 0.0 || known_to_meet(a, b, found.point) ? 0.0 : difference.apart();
    if (gap > 0.0) return -gap;
    if (leans && !rims::prefer_where_they_meet(best, {d, c, a.half.x, a.half.y, b.half.x, b.half.y, sine})) best = way_out(difference, best);
    if (best.reach < known) found = touch_along(a, b, out_of(a.rotation, best.direction), best.reach);
    touch = found;
    return best.reach;
}

}  // namespace mobee::narrow
