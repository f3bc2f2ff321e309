#include "difference.hpp"

#include <limits>

namespace mobee::narrow {

namespace core_support {

// The corner of a hull that is farthest along v.
Vec3 of_hull(const Hull& hull, Vec3 v) {
    std::int32_t best = 0;
    double farthest = -std::numeric_limits<double>::infinity();
    for (std::int32_t k = 0; k < hull.count; ++k) {
        const double along = dot(v, hull.corners[k]);
        if (along > farthest) best = k, farthest = along;
    }
    return hull.corners[best];
}

// The point of a core that is farthest along v, both in its own axes.
Vec3 of_core(const Volume& volume, Vec3 v) {
    const Vec3 half = volume.half;
    switch (volume.kind) {
        case Kind::sphere: return {};
        case Kind::capsule: return {0.0, 0.0, std::copysign(half.y, v.z)};
        case Kind::box: return {std::copysign(half.x, v.x), std::copysign(half.y, v.y), std::copysign(half.z, v.z)};
        case Kind::cylinder: {
            const double side = std::sqrt(v.x * v.x + v.y * v.y), z = std::copysign(half.y, v.z);
            if (side == 0.0) return {half.x, 0.0, z};
            return {half.x * v.x / side, half.x * v.y / side, z};
        }
        case Kind::convex: break;
    }
    return of_hull(volume.hull, v);
}

bool holds(const Volume& v, Vec3 point) {
    const Vec3 p = into(v.rotation, point - v.center), half = v.half;
    if (v.kind == Kind::box) return std::fabs(p.x) < half.x && std::fabs(p.y) < half.y && std::fabs(p.z) < half.z;
    return p.x * p.x + p.y * p.y < half.x * half.x && std::fabs(p.z) < half.y;
}

}  // namespace core_support

bool known_to_meet(const Volume& a, const Volume& b, Vec3 point) {
    using core_support::holds;
    return (holds(a, point) && holds(b, point)) || holds(a, b.center) || holds(b, a.center);
}

Difference::Difference(const Volume& a, const Volume& b) : first(a), second(b), shift(into(a.rotation, b.center - a.center)) {
    for (int column = 0; column < 3; ++column) {
        const Vec3 axis = into(a.rotation, b.rotation.column(column));
        turn.m[column] = axis.x;
        turn.m[3 + column] = axis.y;
        turn.m[6 + column] = axis.z;
    }
}

Vec3 Difference::farthest(Vec3 n) {
    return shift + out_of(turn, core_support::of_core(second, into(turn, n))) - core_support::of_core(first, -n);
}

double Difference::apart() { return closest(*this, 0.0).distance; }

}  // namespace mobee::narrow
