// Two cylinders.
//
// Their difference is two discs and two segments.  Its shortest way out is along an axis, across both axes, a smooth minimum among the
// directions square to one axis, or one where both rims meet: only that last one needs a polytope.
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

// Square to the z axis, which is that of `around`; the other's axis and how far it is away are seen from there.
bool prefer_square_to(Way& best, const Volume& around, const Volume& other, Vec3 axis, Vec3 shift) {
    const Point across = {axis.x, axis.y}, away = {shift.x, shift.y};
    Exit exit = {best.reach, {}};
    if (std::fabs(axis.z) > flat) {
        improve_around({other.half.x, other.half.y, across, axis.z * axis.z, around.half.x}, away, {0.0, 0.0}, exit);
    } else {
        // The other is seen from the side: a rectangle, along the axis and across it.
        improve_around({0.0, 0.0, {0.0, 0.0}, 1.0, around.half.x}, {dot(away, across), cross(across, away)}, {other.half.y, other.half.x}, exit);
        exit.n = exit.n.x * across + exit.n.y * Point{-across.y, across.x};
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

bool Bands::hold(Vec3 n, double half_tangent, double limit) const {
    const double cosine = axis.z, sine = std::sqrt(axis.x * axis.x + axis.y * axis.y), whole = 1.0 + half_tangent * half_tangent;
    const double sin_angle = 2.0 * half_tangent / whole, cos_angle = (2.0 - whole) / whole;
    for (int which = 0; which < 2; ++which) {
        const Vec3 c = which == 0 ? Vec3{0.0, 0.0, 1.0} : axis, other = which == 0 ? axis : Vec3{0.0, 0.0, 1.0};
        const double up = dot(n, c), level = std::sqrt(most(1.0 - up * up, 0.0));
        if (!(sin_angle < 0.5 * level)) continue;
        // Below, `turn` is more than how far the direction square to c may turn.
        const double turn = 1.1 * sin_angle / level;
        const Vec3 square = (1.0 / level) * (n - up * c);
        const double q = dot(square, other), around = std::sqrt(most(1.0 - q * q, 0.0)), least_around = most(around - turn, std::fabs(cosine));
        if (!(least_around > 0.0)) continue;
        // The point of the difference that is farthest along it is off the first's middle by this much along c.
        const double rim = dot(shift, c) - radius[1 - which] * q * cosine / around, cap = height[1 - which] * cosine;
        const double middle = std::fabs(q) > turn ? std::fabs(rim + std::copysign(cap, q * cap)) : std::fabs(rim) + std::fabs(cap);
        const double room = height[which] - middle - radius[1 - which] * sine * turn / least_around;
        // Along c it reaches that far beyond: h cos + room sin is not less than h up to here.
        const double high = std::fabs(up) * cos_angle + level * sin_angle, flat_part = level * cos_angle - std::fabs(up) * sin_angle;
        if (room > 0.0 && flat_part > 0.0 && high * limit <= room * (1.0 + flat_part)) return true;
    }
    return false;
}

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
    Difference difference(a, b);
    const double gap = known_to_meet(a, b, found.point) ? 0.0 : difference.apart();
    if (gap > 0.0) return -gap;
    const Bands bands = {d, c, {a.half.x, b.half.x}, {a.half.y, b.half.y}};
    const Way way = way_out(difference, best, &bands);
    if (way.reach < best.reach) found = touch_along(a, b, out_of(a.rotation, way.direction), way.reach);
    touch = found;
    return way.reach;
}

}  // namespace mobee::narrow
