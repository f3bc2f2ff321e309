// SPDX-License-Identifier: Apache-2.0
// The smallest separation, for a Minkowski difference that contains the origin, by an expanding polytope inside it.
//
// Each step takes the face of the polytope that is closest to the origin (below it, while the polytope does not contain the
// origin) and adds the farthest point along its normal, until there is none.  The reach of the difference along any direction
// tried is a valid separation in spite of rounding errors of the polytope, and the smallest of these is the result.  It is exact for
// polytopes.  With cylinders it is better than 1e-9 m, except where all separations around an axis are nearly as small and the steps end
// first: there it may be too long by 1e-6 of the size.
#include <limits>

#include "difference.hpp"

namespace mobee::narrow {

namespace epa {

constexpr int most_corners = 128, most_faces = 2 * most_corners;
constexpr int full = most_faces - 8;  // reached before there are too many corners
constexpr double exact = 1e-12;       // m, for volumes of up to a metre: difference at which the bounds count as equal
constexpr double infinity = std::numeric_limits<double>::infinity();

// Corners anticlockwise, seen from outside.
struct Face {
    std::int32_t a, b, c;
};

struct Edge {
    std::int32_t from, to;
};

// Arrays that are not initialised, since most polytopes use only a part of them.
struct Polytope {
    double px[most_corners], py[most_corners], pz[most_corners];
    Face face[most_faces];
    double nx[most_faces], ny[most_faces], nz[most_faces];  // unit normals
    double low[most_faces];                                 // distance from the origin
    int faces = 0;

    Vec3 corner(int k) const { return {px[k], py[k], pz[k]}; }
    Vec3 normal(int k) const { return {nx[k], ny[k], nz[k]}; }
    void set(int k, Vec3 p) { px[k] = p.x, py[k] = p.y, pz[k] = p.z; }

    // A face without area is never the closest.
    void add(Face added) {
        const Vec3 a = corner(added.a), u = corner(added.b) - a, v = corner(added.c) - a, n = cross(u, v);
        const double squared = dot(n, n);
        const bool thin = !(squared > 1e-28 * dot(u, u) * dot(v, v));
        const Vec3 out = (1.0 / (thin ? 1.0 : std::sqrt(squared))) * n;
        face[faces] = added;
        nx[faces] = out.x, ny[faces] = out.y, nz[faces] = out.z;
        low[faces] = thin ? infinity : dot(out, a);
        ++faces;
    }

    void take_away(int k) {
        --faces;
        face[k] = face[faces];
        nx[k] = nx[faces], ny[k] = ny[faces], nz[k] = nz[faces];
        low[k] = low[faces];
    }

    // The face that is closest to the origin.
    int closest_face() const {
        double lowest[4] = {infinity, infinity, infinity, infinity};
        int k = 0;
        for (; k + 4 <= faces; k += 4)
            for (int lane = 0; lane < 4; ++lane) lowest[lane] = least(low[k + lane], lowest[lane]);
        for (; k < faces; ++k) lowest[0] = least(low[k], lowest[0]);
        const double found = least(least(lowest[0], lowest[1]), least(lowest[2], lowest[3]));
        for (k = 0; k < faces - 1; ++k)
            if (low[k] == found) break;
        return k;
    }

    // Remove the faces that are visible from a corner, and add new ones from it to the edge of the hole.
    void expand(int added, double tolerance);
};

// Add an edge, or remove it if the other face along it is removed too; returns the number of edges.
inline int toggle(Edge* rim, int count, Edge edge) {
    for (int k = 0; k < count; ++k) {
        if (rim[k].from == edge.to && rim[k].to == edge.from) {
            rim[k] = rim[count - 1];
            return count - 1;
        }
    }
    rim[count] = edge;
    return count + 1;
}

void Polytope::expand(int added, double tolerance) {
    const Vec3 p = corner(added);
    double above[most_faces];
    for (int k = 0; k < faces; ++k) above[k] = nx[k] * p.x + ny[k] * p.y + nz[k] * p.z - low[k];
    int seeing[most_faces], count = 0;
    for (int k = 0; k < faces; ++k) {
        seeing[count] = k;
        count += above[k] > tolerance;
    }
    Edge rim[3 * most_faces];
    int edges = 0;
    while (count > 0) {
        const int k = seeing[--count];
        const Face gone = face[k];
        edges = toggle(rim, edges, {gone.a, gone.b});
        edges = toggle(rim, edges, {gone.b, gone.c});
        edges = toggle(rim, edges, {gone.c, gone.a});
        take_away(k);
    }
    for (int k = 0; k < edges && faces < most_faces; ++k) add({rim[k].from, rim[k].to, added});
}

inline Vec3 normalized(Vec3 v) { return (1.0 / length(v)) * v; }

// Unit vectors perpendicular to u, and to u and the first.
void square_to(Vec3 u, Vec3& one, Vec3& two) {
    const Vec3 a = absolute(u);
    if (a.x <= a.y && a.x <= a.z)
        one = normalized({0.0, -u.z, u.y});
    else if (a.y <= a.z)
        one = normalized({u.z, 0.0, -u.x});
    else
        one = normalized({-u.y, u.x, 0.0});
    two = normalized(cross(u, one));
}

struct Start {
    double size;  // distance of the fourth corner from the plane of the others; 0: the difference is flat
    Vec3 normal;  // of the difference, where it is flat
};

// Set four corners of the difference: the farthest along a direction, and three far from it, unless they are nearly in one plane; 0 1 2
// are anticlockwise seen from outside.
bool spread(Difference& difference, Vec3 n, Polytope& polytope, Start& start) {
    Vec3 t, u;
    square_to(n, t, u);
    const Vec3 found[4] = {difference.farthest(n), difference.farthest(0.94 * t - 0.33 * n),
                           difference.farthest(0.82 * u - 0.47 * t - 0.33 * n), difference.farthest(-0.82 * u - 0.47 * t - 0.33 * n)};
    const Vec3 a = found[1] - found[0], b = found[2] - found[0], c = found[3] - found[0], across = cross(b, a);
    const double size = length(across), width = dot(across, c) / size;
    if (!(width > 0.01 * length(c)) || !(size > 0.01 * dot(a, a)) || !(size > 0.01 * dot(b, b))) return false;
    start.size = width;
    for (int k = 0; k < 4; ++k) polytope.set(k, found[k]);
    return true;
}

// Set four corners of the difference, 0 1 2 anticlockwise seen from outside.
Start tetrahedron(Difference& difference, Polytope& polytope) {
    Vec3 axis[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    Vec3 found[4];
    double width = 0.0, turned = 0.0;
    constexpr int tried[4] = {2, 6, 4, 2};
    for (int count = 0; count < 4; ++count) {
        // Each is the farthest from the first, along directions perpendicular to those found before.
        width = count == 0 ? -1.0 : tie;
        found[count] = found[0];
        for (int which = 0; which < tried[count]; ++which) {
            const double turn = which % 2 == 0 ? 1.0 : -1.0;
            const Vec3 along = turn * axis[which / 2], p = difference.farthest(along);
            const double off = dot(along, p - found[0]);
            if (count == 0 ? which == 0 || off > width : off > width) width = off, turned = turn, found[count] = p;
        }
        if (width == tie) return {0.0, axis[0]};
        const Vec3 u = found[1] - found[0];
        if (count == 1) square_to(u, axis[0], axis[1]);
        if (count == 2) axis[0] = normalized(cross(u, found[2] - found[0]));
    }
    // If the last is in front of 0 1 2, their order is reversed.
    if (turned > 0.0) std::swap(found[0], found[1]);
    for (int k = 0; k < 4; ++k) polytope.set(k, found[k]);
    return {width, axis[0]};
}

}  // namespace epa

// A last search near a separation of curved volumes, if the expanding polytope did not end because many are nearly as small.
namespace polish {

constexpr int ring = 64;  // directions tried around the axis of either volume
constexpr int rounds = 100;
constexpr double gain = 1e-13;    // m: larger than rounding errors
constexpr double finest = 1e-8;   // rad; the reach is then within its square of a smooth minimum
constexpr double pi = 3.14159265358979323846;

bool improve(Difference& difference, Separation& best, Vec3 direction, double by) {
    const double reach = dot(direction, difference.farthest(direction));
    if (!(reach < best.reach - by)) return false;
    best = {reach, direction};
    return true;
}

// A direction near the known one, or perpendicular to the axis of either volume, with the smallest reach of the difference.  The search
// rotates about the axes of both volumes: if a smallest reach of cylinders or boxes is at a crease, it is perpendicular to one of them.
Separation search(Difference& difference, Separation best) {
    for (int which = 0; which < 2 * ring; ++which) {
        const double angle = 2.0 * pi * which / ring;
        const Vec3 round = {std::cos(angle), std::sin(angle), 0.0};
        improve(difference, best, which < ring ? round : out_of(difference.turn, round), tie);
    }
    double step = 0.1;
    for (int round = 0; round < rounds && step >= finest; ++round) {
        bool better = false;
        for (int which = 0; which < 12; ++which) {
            Vec3 axis;
            if (which < 6)
                axis[which / 2] = 1.0;
            else
                axis = difference.turn.column(which / 2 - 3);
            const double sine = which % 2 == 0 ? std::sin(step) : -std::sin(step), cosine = std::cos(step);
            const Vec3 n = best.direction;
            const Vec3 turned = cosine * n + sine * cross(axis, n) + ((1.0 - cosine) * dot(axis, n)) * axis;
            better |= improve(difference, best, epa::normalized(turned), gain);
        }
        if (!better) step *= 0.5;
    }
    return best;
}

}  // namespace polish

Separation least_separation(Difference& difference, Separation known) {
    epa::Polytope polytope;
    epa::Start start;
    if (!epa::spread(difference, known.direction, polytope, start)) start = epa::tetrahedron(difference, polytope);
    const double exact = epa::exact * most(start.size, 1.0);
    for (const epa::Face face : {epa::Face{0, 1, 2}, {2, 1, 3}, {0, 2, 3}, {1, 0, 3}}) polytope.add(face);
    Separation best = {epa::infinity, known.direction};
    double low = -epa::infinity;
    Vec3 n = start.normal;
    for (int count = 4; count < epa::most_corners; ++count) {
        if (start.size > 0.0) {
            const int face = polytope.closest_face();
            n = polytope.normal(face);
            low = polytope.low[face];
        }
        const Vec3 p = difference.farthest(n);
        const double reach = dot(n, p);
        if (reach < best.reach) best = {reach, n};
        if (start.size == 0.0 || best.reach <= 0.0 || least(least(best.reach, known.reach - tie), reach) - low <= exact) break;
        if (polytope.faces > epa::full) {
            best = polish::search(difference, best.reach < known.reach - tie ? best : known);
            break;
        }
        polytope.set(count, p);
        polytope.expand(count, 0.1 * exact);
    }
    return best.reach < known.reach - tie ? best : known;
}

}  // namespace mobee::narrow
