#include "outline.hpp"

namespace mobee::narrow {

namespace outline_of_disc {

constexpr int most_steps = 80, most_arcs = 16;
constexpr double settled = 1e-10;  // rad; the reach is then within its square of the minimum

inline Point normalized(Point v) { return (1.0 / std::sqrt(dot(v, v))) * v; }

// A direction, the outline's point that is farthest along it, and what follows from them.
struct Support {
    Point n, point;
    double reach;
    double slope;   // of the reach, against the clock
    double radius;  // of curvature
};

inline Support support(const Disc& disc, Point corner, Point n) {
    const double q = dot(n, disc.beside), squared = disc.lean + q * q, k = disc.radius / std::sqrt(squared);
    const Point point = corner + (k * disc.lean + disc.ball) * n + (k * q) * disc.beside;
    return {n, point, dot(n, point), cross(n, point), k * disc.lean / squared + disc.ball};
}

struct Arc {
    Support from, to;
};

// Whether no smooth minimum below the limit is between the two.  The reach h there is not below the distance of the chord, where that
// is positive; with its slope it is bound by h'' = radius - h, and the radius has its extremes at the ends or where n is across
// the disc's axis.
bool hopeless(const Disc& disc, const Arc& arc, double limit) {
    const Point chord = arc.to.point - arc.from.point, turn = arc.to.n - arc.from.n;
    const double far = std::sqrt(dot(chord, chord)), area = cross(arc.from.point, chord);
    if (area >= limit * far) return true;
    const bool flattest = dot(arc.from.n, disc.beside) * dot(arc.to.n, disc.beside) < 0.0;
    const double high = flattest ? disc.radius / std::sqrt(disc.lean) + disc.ball : most(arc.from.radius, arc.to.radius);
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

// The minimum of an arc along which the slope rises through zero (Newton, within the part where it does).
void descend(const Disc& disc, Point corner, Arc arc, Exit& best) {
    Support here = support(disc, corner, across_chord(arc));
    for (int step = 0; step < most_steps; ++step) {
        (here.slope < 0.0 ? arc.from : arc.to) = here;
        const double rise = here.radius - here.reach, turn = rise > 0.0 ? -here.slope / rise : 1.0;
        if (std::fabs(turn) < settled) break;
        Point next = here.n + turn * Point{-here.n.y, here.n.x};
        next = std::fabs(turn) < 0.5 ? normalized(next) : across_chord(arc);
        if (!inside(arc, next)) next = across_chord(arc);
        if (!inside(arc, next)) break;
        here = support(disc, corner, next);
    }
    if (here.reach < best.reach - tie) best = {here.reach, here.n};
}

}  // namespace outline_of_disc

Point bulge(const Disc& disc, Point n) { return outline_of_disc::support(disc, {0.0, 0.0}, n).point; }

void improve_between(const Disc& disc, Point corner, Point from, Point to, Exit& best) {
    using namespace outline_of_disc;
    Arc stack[most_arcs];
    stack[0] = {support(disc, corner, from), support(disc, corner, to)};
    int waiting = 1;
    for (int step = 0; step < most_steps && waiting > 0; ++step) {
        const Arc arc = stack[--waiting];
        if (hopeless(disc, arc, best.reach - tie)) continue;
        // Where h is not above the least radius at both ends it is so between them, and h is convex.
        if (most(arc.from.reach, arc.to.reach) <= least(arc.from.radius, arc.to.radius) + tie) {
            if (arc.from.slope < 0.0 && arc.to.slope > 0.0) descend(disc, corner, arc, best);
            continue;
        }
        if (waiting + 2 > most_arcs) continue;
        const Point n = across_chord(arc);
        if (!inside(arc, n)) continue;
        const Support middle = support(disc, corner, n);
        stack[waiting++] = {middle, arc.to};
        stack[waiting++] = {arc.from, middle};
    }
}

}  // namespace mobee::narrow
