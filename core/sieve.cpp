// Drops most pairs whose balls overlap though the volumes do not.
//
// A pair is only dropped when a separating direction or the exact distance says so by a margin; what is left, the narrow phase decides.
#include <cmath>

#include "pairs.hpp"

namespace mobee {

namespace sieves {

constexpr double margin = 1e-9;  // m: far above rounding, far below what costs time
constexpr double tiny = 1e-30;

inline double squared(Vec3 v) { return dot(v, v); }
inline Vec3 absolute(Vec3 v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

// Squared distance of the point w from the segment -v .. v.
inline double point_segment(Vec3 w, Vec3 v, double inverse) {
    const double t = unit(dot(v, w) * inverse);
    return squared(w - t * v);
}

// Squared distance of the segments w - u .. w + u and -v .. v; parallel ones too, for t and s follow each other.
inline double segment_segment(Vec3 w, const Outline& one, const Outline& two) {
    const Vec3 u = three(one.core), v = three(two.core);
    const double b = dot(u, v), c = dot(u, w), f = dot(v, w);
    double s = unit((b * f - c * two.squared) / most(one.squared * two.squared - b * b, tiny));
    const double t = unit((b * s + f) * two.inverse);
    s = unit((b * t - c) * one.inverse);
    return squared(w + s * u - t * v);
}

// Squared distance of a point from a box about the origin.
inline double point_box(Vec3 p, Vec3 half) {
    const Vec3 q = absolute(p);
    return squared({most(q.x - half.x, 0.0), most(q.y - half.y, 0.0), most(q.z - half.z, 0.0)});
}

// False if the segment c - k .. c + k is farther than `reach` from a box about the origin: shown by the box's own axes, or by the
// direction between two points found by going to and fro twice.
inline bool segment_near_box(Vec3 c, Vec3 k, double inverse, Vec3 half, double reach) {
    const Vec3 in = absolute(c), along = absolute(k);
    const Vec3 end{most(in.x - along.x, 0.0), most(in.y - along.y, 0.0), most(in.z - along.z, 0.0)};
    if (point_box(end, half) > reach * reach) return false;
    double s = unit(-dot(c, k) * inverse);
    Vec3 n;
    for (int round = 0; round < 2; ++round) {
        const Vec3 p = c + s * k;
        const Vec3 q{clamp(p.x, -half.x, half.x), clamp(p.y, -half.y, half.y), clamp(p.z, -half.z, half.z)};
        s = unit(dot(q - c, k) * inverse);
        n = c + s * k - q;
    }
    const double gap = dot(n, c) - std::fabs(dot(n, k)) - dot(absolute(n), half);
    return gap <= 0.0 || gap * gap < reach * reach * squared(n);
}

// Whether two boxes overlap along the line of their centres.
inline bool boxes_near(Vec3 w, const Volume& one, const Volume& two) {
    const Vec3 c = into(two.rotation, w), d = into(one.rotation, w);
    return squared(w) - margin < dot(one.half, absolute(d)) + dot(two.half, absolute(c));
}

}  // namespace sieves

void sieve(const Scene& scene, Placed& placed, Array<Pair>& list) {
    const Robot& robot = *scene.robot;
    const auto shapes = static_cast<std::int32_t>(robot.shapes());
    std::size_t kept = 0;
    for (const Pair pair : list) {
        list[kept] = pair;
        std::int32_t a = pair.first, b = pair.second;
        const Outline* one = &placed.outline[a];
        const Outline* two = b < shapes ? &placed.outline[b] : &scene.outline[b - shapes];
        if (one->kind > two->kind) {
            std::swap(one, two);
            std::swap(a, b);
        }
        const Vec3 w = three(one->center - two->center);
        const double reach = one->radius + two->radius + sieves::margin;
        const auto volume = [&](std::int32_t i) -> const Volume& {
            return i < shapes ? placed_volume(robot, placed, i) : scene.volume[i - shapes];
        };
        bool near = true;
        if (two->kind <= Kind::capsule) {
            near = (one->kind == Kind::sphere ? sieves::point_segment(w, three(two->core), two->inverse)
                                              : sieves::segment_segment(w, *one, *two)) < reach * reach;
        } else if (two->kind == Kind::box) {
            const Volume& box = volume(b);
            const Vec3 c = into(box.rotation, w);
            if (one->kind == Kind::sphere) near = sieves::point_box(c, box.half) < reach * reach;
            if (one->kind == Kind::capsule) near = sieves::segment_near_box(c, into(box.rotation, three(one->core)), one->inverse, box.half, reach);
            if (one->kind == Kind::box) near = sieves::boxes_near(w, volume(a), box);
        }
        kept += near;
    }
    list.shorten(kept);
}

}  // namespace mobee
