// SPDX-License-Identifier: Apache-2.0
#include "outline.hpp"

namespace mobee::narrow {

namespace outline_of_disc {

constexpr int most_steps = 80, most_arcs = 16;
constexpr double level = 1e-12;    // this near to an axis of the plane, rounding must not decide the side
constexpr double settled = 1e-10;  // rad; the reach is then within its square of the minimum

inline Point normalized(Point v) { return (1.0 / std::sqrt(dot(v, v))) * v; }

// Perpendicular to the axis.
inline Point beside(const Disc& disc) { return {-disc.axis.y, disc.axis.x}; }

// A direction, the outline's point that is farthest along it, and derived values.
struct Support {
    Point n, point;
    double reach;
    double slope;   // of the reach, anticlockwise
    double radius;  // of curvature
};

inline Support support(const Disc& disc, Point corner, Point n) {
    const double q = cross(disc.axis, n), squared = disc.lean + q * q, k = disc.radius / std::sqrt(squared);
    const Point point = corner + (k * disc.lean + disc.ball) * n + (k * q) * beside(disc);
    return {n, point, dot(n, point), cross(n, point), k * disc.lean / squared + disc.ball};
}

struct Arc {
    Support from, to;
};

// Return whether there is no smooth minimum below the limit between the two.  The reach h is at least the distance of the chord, if that
// is positive; its slope obeys h'' = radius - h, and the radius has its extremes at the ends or along the axis.
bool hopeless(const Disc& disc, const Arc& arc, double limit) {
    const Point chord = arc.to.point - arc.from.point, turn = arc.to.n - arc.from.n;
    const double far = std::sqrt(dot(chord, chord)), area = cross(arc.from.point, chord);
    if (area >= limit * far) return true;
    const bool along = cross(disc.axis, arc.from.n) * cross(disc.axis, arc.to.n) < 0.0;
    const double high = along ? disc.radius / std::sqrt(disc.lean) + disc.ball : most(arc.from.radius, arc.to.radius);
    const double ends = least(arc.from.reach, arc.to.reach);
    if (ends >= high - tie) return true;  // concave
    if (arc.from.slope * arc.to.slope <= 0.0) return false;
    const double low = area > 0.0 ? least(ends, area / far) : -std::sqrt(dot(arc.from.point, arc.from.point));
    const double angle = 1.5708 * std::sqrt(dot(turn, turn)), change = angle * (high - low);
    return change < (arc.from.slope < 0.0 ? -arc.from.slope : arc.to.slope);  // steep
}

inline Point across_chord(const Arc& arc) {
    const Point chord = arc.to.point - arc.from.point;
    return normalized({chord.y, -chord.x});
}

inline bool inside(const Arc& arc, Point n) { return cross(arc.from.n, n) > 0.0 && cross(n, arc.to.n) > 0.0; }

// The minimum of an arc on which the slope increases through zero (Newton's method, with bisection where it is slow).
//
// Along n = start + t aside, not made a unit, the disc reaches radius * swing, where swing^2 = lean n.n + u^2 and u = axis x n = w + v t.
// The slope times a power of n's length is then across - along t + radius * u (v - w t) / swing.
void descend(const Disc& disc, Point corner, const Arc& arc, Exit& best) {
    const Point start = across_chord(arc), aside = {-start.y, start.x};
    const double w = cross(disc.axis, start), v = cross(disc.axis, aside), along = dot(corner, start), across = dot(corner, aside);
    // No arc is more than a quarter turn, so that its ends are in front of the start, apart from rounding.
    const auto tangent = [start](Point n) { return cross(start, n) / most(dot(start, n), flat); };
    double low = tangent(arc.from.n), high = tangent(arc.to.n), last = high - low, t = 0.0;
    for (int step = 0; step < most_steps; ++step) {
        const double u = w + v * t, turned = v - w * t, per_swing = 1.0 / std::sqrt(disc.lean * (1.0 + t * t) + u * u);
        const double slope = across - along * t + disc.radius * per_swing * (u * turned);
        const double grown = (v * u + disc.lean * t) * per_swing * per_swing;
        const double rise = disc.radius * per_swing * (v * turned - w * u - u * turned * grown) - along;
        (slope < 0.0 ? low : high) = t;
        const double turn = rise > 0.0 ? -slope / rise : high - low;
        if (std::fabs(turn) < settled) break;
        const bool fast = std::fabs(turn) <= 0.5 * last && t + turn > low && t + turn < high;
        const double next = fast ? t + turn : 0.5 * (low + high);
        last = std::fabs(next - t);
        t = next;
    }
    const Support found = support(disc, corner, normalized(start + t * aside));
    if (found.reach < best.reach - tie) best = {found.reach, found.n};
}

// The smooth minima along an arc of at most a quarter turn; the outline is that of the disc about a corner.
void improve_between(const Disc& disc, Point corner, const Arc& whole, Exit& best) {
    Arc stack[most_arcs];
    stack[0] = whole;
    int waiting = 1;
    for (int step = 0; step < most_steps && waiting > 0; ++step) {
        const Arc arc = stack[--waiting];
        if (hopeless(disc, arc, best.reach - tie)) continue;
        // If h is not above the least radius at both ends, the same holds between them, and h is convex.
        if (most(arc.from.reach, arc.to.reach) <= least(arc.from.radius, arc.to.radius) + tie) {
            if (arc.from.slope < 0.0 && arc.to.slope > 0.0) descend(disc, corner, arc, best);
            continue;
        }
        const Point n = across_chord(arc);
        if (waiting + 2 > most_arcs || !inside(arc, n)) continue;
        const Support middle = support(disc, corner, n);
        stack[waiting++] = {middle, arc.to};
        stack[waiting++] = {arc.from, middle};
    }
}

// The support opposite or not, `side` -1 or 1, moved.
inline Support placed(const Support& own, double side, Point by) {
    const Point n = side * own.n, point = side * own.point + by;
    return {n, point, dot(n, point), cross(n, point), own.radius};
}

// Between two kinks, and on the opposite side, with the disc's outline about a corner.
inline void improve_part(const Disc& disc, Point shift, Point corner, const Support& from, const Support& to, Exit& best) {
    const Point first = corner + from.point, chord = to.point - from.point;
    const double reach = dot(from.n, first), off = dot(from.n, shift);
    const double area = cross(first, chord), aside = cross(shift, chord), square = dot(chord, chord);
    // Faster than deciding between the two sides, since mostly neither can be shorter.
    const double limit = least(best.reach, reach - std::fabs(off)) - tie, lower = area - std::fabs(aside);
    if (reach - std::fabs(off) >= best.reach - tie && lower > 0.0 && lower * lower >= limit * limit * square) return;
    const double far = std::sqrt(square);
    for (const double side : {1.0, -1.0}) {
        if (reach + side * off < best.reach - tie) best = {reach + side * off, side * from.n};
        if (area + side * aside >= (best.reach - tie) * far) continue;
        const Point center = shift + side * corner;
        improve_between(disc, center, {placed(from, side, center), placed(to, side, center)}, best);
    }
}

}  // namespace outline_of_disc

void improve_around(const Disc& seen, Point shift, Point half, Exit& best) {
    using namespace outline_of_disc;
    // A disc seen edge-on has no smooth minimum.
    if (seen.lean <= flat * flat) return;
    // Mirrored, so that the axis points into the first quadrant and the kinks are in this order.
    const double size = std::sqrt(dot(seen.axis, seen.axis));
    const bool leans = size > flat;
    const double mirror = leans && seen.axis.x * seen.axis.y < -level ? -1.0 : 1.0;
    Disc disc = seen;
    disc.axis = {std::fabs(seen.axis.x), std::fabs(seen.axis.y)};
    disc.end = {std::fabs(seen.end.x), std::fabs(seen.end.y)};
    shift.x *= mirror;
    const Point x = {1.0, 0.0}, y = {0.0, 1.0}, square = leans ? (1.0 / size) * beside(disc) : -x, end = disc.end;
    const Support at_x = support(disc, {0.0, 0.0}, x), at_y = support(disc, {0.0, 0.0}, y);
    const Support at_square = {square, (disc.radius + disc.ball) * square, 0.0, 0.0, disc.radius * disc.lean + disc.ball};
    Exit found = best;
    improve_part(disc, shift, half + end, at_x, at_y, found);
    improve_part(disc, shift, Point{-half.x, half.y} + end, at_y, at_square, found);
    improve_part(disc, shift, Point{-half.x, half.y} - end, at_square, placed(at_x, -1.0, {0.0, 0.0}), found);
    if (found.reach < best.reach) best = {found.reach, {mirror * found.n.x, found.n.y}};
}

}  // namespace mobee::narrow
