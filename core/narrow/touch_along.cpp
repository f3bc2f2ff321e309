// SPDX-License-Identifier: Apache-2.0
// The contact point of two volumes: the middle of the overlap of their features, seen along the normal, midway between their surfaces.
//
// A feature is the vertex, edge or face of a volume that lies farthest along a direction, as a polygon in the plane perpendicular to it.
#include <limits>

#include "array.hpp"
#include "narrow.hpp"
#include "touch_along.hpp"

namespace mobee::narrow {

namespace feature {

constexpr int cap_corners = 32;  // of the polygon that represents a cap

// The plane perpendicular to a unit normal: t and u span it, the second volume's centre is its origin.
struct Plane {
    Vec3 normal, t, u;

    explicit Plane(Vec3 n) : normal(n) {
        // The root frame's axis that is farthest from the normal, made perpendicular to it.
        const Vec3 a = absolute(n);
        Vec3 axis;
        axis[a.x <= a.y && a.x <= a.z ? 0 : a.y <= a.z ? 1 : 2] = 1.0;
        t = axis - dot(axis, n) * n;
        t = over(t, length(t));
        u = cross(n, t);
    }
    Point seen(Vec3 p) const { return {dot(t, p), dot(u, p)}; }
};

std::int32_t most_points(const Volume& v) {
    if (v.kind == Kind::convex) return v.hull.count;
    return v.kind == Kind::cylinder ? cap_corners : 4;
}

// The coordinate of the end that is farthest along a direction; the middle if both are equally far.
inline double end(double slope, double half) { return std::fabs(slope) < aligned ? 0.0 : slope > 0.0 ? half : -half; }

// The corners of a hull that are farthest along n (in its own axes), within rounding.
int of_hull(const Volume& v, Vec3 n, const Plane& plane, Vec3 center, Point* out) {
    double farthest = -std::numeric_limits<double>::infinity(), size = 0.0;
    for (std::int32_t k = 0; k < v.hull.count; ++k) {
        const Vec3 p = v.hull.corners[k], a = absolute(p);
        farthest = most(farthest, dot(n, p));
        size = most(most(size, a.x), most(a.y, a.z));
    }
    int found = 0;
    for (std::int32_t k = 0; k < v.hull.count; ++k) {
        const Vec3 p = v.hull.corners[k];
        if (dot(n, p) >= farthest - aligned * size) out[found++] = plane.seen(center + out_of(v.rotation, p));
    }
    return outline(out, found, aligned * size);
}

int of_cap(const Volume& v, double z, const Plane& plane, Vec3 center, Point* out) {
    // The cosines of the first quarter, in steps of a 32nd turn.
    constexpr double cosine[9] = {1.0, 0.9807852804032304, 0.9238795325112867, 0.8314696123025452, 0.7071067811865476, 0.5555702330196023, 0.38268343236508984, 0.19509032201612833, 0.0};
    const Point middle = plane.seen(center + out_of(v.rotation, {0.0, 0.0, z}));
    const Point x = v.half.x * plane.seen(v.rotation.column(0)), y = v.half.x * plane.seen(v.rotation.column(1));
    for (int k = 0; k < 8; ++k) {
        const Point along = cosine[k] * x + cosine[8 - k] * y, beside = cosine[k] * y - cosine[8 - k] * x;
        out[k] = middle + along;
        out[k + 8] = middle + beside;
        out[k + 16] = middle - along;
        out[k + 24] = middle - beside;
    }
    return cap_corners;
}

// The feature of a volume farthest along a direction, in its own axes: a point and up to two perpendicular half edges, or a cap.
struct Feature {
    Vec3 n;  // the direction
    Vec3 point, edge;
    int count;  // of corners; 0: see `of_hull`
};

Feature feature_of(const Volume& v, Vec3 direction) {
    const Vec3 n = into(v.rotation, direction);
    Feature found = {n, {}, {}, 1};
    if (v.kind == Kind::convex) return {n, {}, {}, 0};
    if (v.kind == Kind::box) {
        found.point = {end(n.x, v.half.x), end(n.y, v.half.y), end(n.z, v.half.z)};
        found.edge = v.half - absolute(found.point);
    } else if (v.kind != Kind::sphere) {
        found.point.z = end(n.z, v.half.y);
        found.edge.z = v.half.y - std::fabs(found.point.z);
        if (v.kind == Kind::cylinder) {
            const double side = std::sqrt(n.x * n.x + n.y * n.y);
            if (side < aligned) return {n, found.point, {}, cap_corners};
            found.point.x = v.half.x * n.x / side;
            found.point.y = v.half.x * n.y / side;
        }
    }
    const int edges = (found.edge.x > 0.0) + (found.edge.y > 0.0) + (found.edge.z > 0.0);
    found.count = edges == 0 ? 1 : edges == 1 ? 2 : 4;
    return found;
}

// Write the corners of a feature in cyclic order; returns their number.  The centre is relative to the plane's origin.
int corners(const Volume& v, const Feature& feature, const Plane& plane, Vec3 center, Point* out) {
    const Vec3 point = feature.point, edge = feature.edge;
    if (feature.count == 0) return of_hull(v, feature.n, plane, center, out);
    if (feature.count == cap_corners) return of_cap(v, point.z, plane, center, out);
    // In cyclic order around a square; a single edge takes two corners that differ in both signs.
    constexpr double round[4][2] = {{1.0, 1.0}, {-1.0, 1.0}, {-1.0, -1.0}, {1.0, -1.0}};
    for (int k = 0; k < feature.count; ++k) {
        const double one = round[k][0], two = feature.count == 2 ? one : round[k][1];
        const Vec3 corner = edge.x > 0.0 ? Vec3{point.x + one * edge.x, point.y + two * edge.y, point.z + two * edge.z}
                                         : Vec3{point.x, point.y + one * edge.y, point.z + two * edge.z};
        out[k] = plane.seen(center + out_of(v.rotation, corner));
    }
    return feature.count;
}

// The reach of a volume from its centre along a unit direction of the root frame.
double reach(const Volume& v, Vec3 direction) {
    const Vec3 n = into(v.rotation, direction);
    switch (v.kind) {
        case Kind::sphere: return v.radius;
        case Kind::capsule: return v.radius + v.half.y * std::fabs(n.z);
        case Kind::cylinder: return v.half.x * std::sqrt(n.x * n.x + n.y * n.y) + v.half.y * std::fabs(n.z);
        case Kind::box: return dot(v.half, absolute(n));
        case Kind::convex: break;
    }
    double farthest = -std::numeric_limits<double>::infinity();
    for (std::int32_t k = 0; k < v.hull.count; ++k) farthest = most(farthest, dot(n, v.hull.corners[k]));
    return farthest;
}

}  // namespace feature

int outline(Point* points, int count, double near) {
    int current = 0;
    for (int k = 1; k < count; ++k) {
        const double ahead = points[k].x - points[current].x;
        if (ahead < -near || (ahead <= near && points[k].y < points[current].y)) current = k;
    }
    int kept = 0;
    while (true) {
        std::swap(points[kept], points[current]);
        const Point from = points[kept++];
        // The start is a candidate too; choosing it ends the march.
        int following = 0;
        Point f = {points[0].x - from.x, points[0].y - from.y};
        for (int k = kept; k < count; ++k) {
            const Point d = {points[k].x - from.x, points[k].y - from.y};
            const double turn = f.x * d.y - f.y * d.x, before = std::sqrt(f.x * f.x + f.y * f.y), now = std::sqrt(d.x * d.x + d.y * d.y);
            const bool right = turn < -near * now, same = turn <= near * now && now > before && f.x * d.x + f.y * d.y > 0.0;
            if (now > near && (before <= near || right || same)) following = k, f = d;
        }
        if (following == 0) return kept;
        current = following;
    }
}

namespace polygon {

constexpr double near = 1e-9;  // m: a corner this close to an edge lies on it

// The mean of the outline: of a polygon, however thin, of a segment or of a point.
Point middle(const Point* points, int count) {
    double total = 0.0;
    Point sum = {0.0, 0.0}, p = points[count - 1];
    for (int k = 0; k < count; ++k) {
        const Point q = points[k];
        const double step = std::sqrt((q.x - p.x) * (q.x - p.x) + (q.y - p.y) * (q.y - p.y));
        total += step;
        sum.x += step * (p.x + q.x) / 2.0;
        sum.y += step * (p.y + q.y) / 2.0;
        p = q;
    }
    if (total <= near) return p;
    return {sum.x / total, sum.y / total};
}

// The middle of the outline of a polygon or segment cut by each side of another polygon (Sutherland and Hodgman).
Point clipped(Point* one, int count, const Point* window, int sides, Point* spare, int room) {
    double area = 0.0;
    for (int k = 1; k < sides - 1; ++k) {
        const Point a = {window[k].x - window[0].x, window[k].y - window[0].y};
        area += a.x * (window[k + 1].y - window[0].y) - a.y * (window[k + 1].x - window[0].x);
    }
    const double turn = area >= 0.0 ? 1.0 : -1.0;
    for (int k = 0; k < sides; ++k) {
        const Point p = window[k], q = window[k + 1 < sides ? k + 1 : 0];
        const Point d = {q.x - p.x, q.y - p.y};
        const double length = std::sqrt(d.x * d.x + d.y * d.y);
        if (!(length > near)) continue;
        const int left = cut(one, count, p, {-turn * d.y / length, turn * d.x / length}, spare, room);
        if (left == 0) break;
        count = left;
        std::swap(one, spare);
    }
    return middle(one, count);
}

Point crossing(const Point* one, const Point* two) {
    const Vec3 c = {(one[0].x + one[1].x) / 2.0, (one[0].y + one[1].y) / 2.0, 0.0};
    const Vec3 u = {(one[1].x - one[0].x) / 2.0, (one[1].y - one[0].y) / 2.0, 0.0};
    const Vec3 p = {(two[0].x + two[1].x) / 2.0, (two[0].y + two[1].y) / 2.0, 0.0};
    const Vec3 v = {(two[1].x - two[0].x) / 2.0, (two[1].y - two[0].y) / 2.0, 0.0};
    const auto [s, t] = closest_parameters(c - p, u, v);
    const Vec3 found = 0.5 * (c + s * u + p + t * v);
    return {found.x, found.y};
}

// The middle of the overlap of two convex features (corners in order); the memory holds `room` points.
Point shared(Point* one, int ones, Point* two, int twos, Point* spare, int room) {
    if (ones == 1 && twos == 1) return {(one[0].x + two[0].x) / 2.0, (one[0].y + two[0].y) / 2.0};
    if (ones == 2 && twos == 2) return crossing(one, two);
    if (twos < ones) {
        std::swap(one, two);
        std::swap(ones, twos);
    }
    if (ones == 1) return one[0];
    // The polygon that clips the other one has few sides, but it is not a segment.
    return ones == 2 ? clipped(one, ones, two, twos, spare, room) : clipped(two, twos, one, ones, spare, room);
}

}  // namespace polygon

int cut(const Point* points, int count, Point on, Point inward, Point* out, int room) {
    int kept = 0;
    Point p = points[count - 1];
    double before = (p.x - on.x) * inward.x + (p.y - on.y) * inward.y;
    for (int k = 0; k < count; ++k) {
        const Point q = points[k];
        const double here = (q.x - on.x) * inward.x + (q.y - on.y) * inward.y;
        const bool crosses = (here < -polygon::near && before > polygon::near) || (here > polygon::near && before < -polygon::near);
        if (kept < room && crosses) {
            const double weight = before / (before - here);
            out[kept++] = {p.x + weight * (q.x - p.x), p.y + weight * (q.y - p.y)};
        }
        if (kept < room && here >= -polygon::near) out[kept++] = q;
        p = q;
        before = here;
    }
    return kept;
}

namespace feature {

// The middle of the overlap of the features of two volumes; the second's centre is the plane's origin.
Point shared(const Volume& a, const Volume& b, const Plane& plane) {
    const Vec3 center = a.center - b.center;
    const Feature of_a = feature_of(a, -plane.normal), of_b = feature_of(b, plane.normal);
    // Mostly one of them is a vertex, which is then the middle.
    if (of_a.count == 1 && of_b.count > 1) return plane.seen(center + out_of(a.rotation, of_a.point));
    if (of_b.count == 1 && of_a.count > 1) return plane.seen(Vec3{} + out_of(b.rotation, of_b.point));
    const int room = most_points(a) + most_points(b);
    constexpr int here = 3 * 64;
    Point few[here];
    Array<Point> many;
    Point* memory = few;
    if (3 * room > here) {
        many.reserve(3 * room);
        memory = many.data();
    }
    Point *one = memory, *two = one + room, *spare = two + room;
    const int ones = corners(a, of_a, plane, center, one), twos = corners(b, of_b, plane, Vec3{}, two);
    return polygon::shared(one, ones, two, twos, spare, room);
}

}  // namespace feature

Touch touch_along(const Volume& a, const Volume& b, Vec3 normal, double depth) {
    const feature::Plane plane(normal);
    const Point at = feature::shared(a, b, plane);
    const double height = feature::reach(b, normal) - depth / 2.0;
    return {normal, b.center + at.x * plane.t + at.y * plane.u + height * normal};
}

}  // namespace mobee::narrow
