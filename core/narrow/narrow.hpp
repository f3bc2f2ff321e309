// SPDX-License-Identifier: Apache-2.0
// The narrow phase: two volumes at a time.  A function for each pair of kinds; `overlap` in overlap.cpp chooses.
#pragma once

#include <cmath>
#include <utility>

#include "volume.hpp"

namespace mobee::narrow {

constexpr double touching = 1e-10;  // m: a smaller distance does not define a direction
constexpr double tie = 1e-9;        // m: a separation must be smaller by more than this to replace an earlier one
constexpr double flat = 1e-9;       // sine of the angle below which a line counts as parallel to a face
constexpr double aligned = 1e-6;    // sine of the angle below which a direction counts as perpendicular to an edge or a face

// -1 or 1; near zero always 1, so that rounding cannot decide.
inline double sign(double value) { return value < -tie ? -1.0 : 1.0; }

// The shorter direction of separation along an axis; `value`: position of the second volume relative to the first.
inline double away(double value) { return value > tie ? -1.0 : 1.0; }

// Of a plane.
struct Point {
    double x, y;
};

inline Point operator+(Point a, Point b) { return {a.x + b.x, a.y + b.y}; }
inline Point operator-(Point a, Point b) { return {a.x - b.x, a.y - b.y}; }
inline Point operator-(Point a) { return {-a.x, -a.y}; }
inline Point operator*(double s, Point a) { return {s * a.x, s * a.y}; }
inline double dot(Point a, Point b) { return a.x * b.x + a.y * b.y; }
inline double cross(Point a, Point b) { return a.x * b.y - a.y * b.x; }

inline Vec3 over(Vec3 v, double s) { return {v.x / s, v.y / s, v.z / s}; }

inline Vec3 absolute(Vec3 v) { return {std::fabs(v.x), std::fabs(v.y), std::fabs(v.z)}; }

// The radius by which a volume is larger than its core.
inline double rounding(const Volume& v) { return v.kind <= Kind::capsule ? v.radius : 0.0; }

// See `overlap` for these; the order of the kinds is that of their names.
double sphere_sphere(const Volume& a, const Volume& b, Touch& touch);
double sphere_capsule(const Volume& a, const Volume& b, Touch& touch);
double capsule_capsule(const Volume& a, const Volume& b, Touch& touch);
double sphere_box(const Volume& a, const Volume& b, Touch& touch);
double capsule_box(const Volume& a, const Volume& b, Touch& touch);
double sphere_cylinder(const Volume& a, const Volume& b, Touch& touch);
double capsule_cylinder(const Volume& a, const Volume& b, Touch& touch);
double cylinder_cylinder(const Volume& a, const Volume& b, Touch& touch);
double cylinder_box(const Volume& a, const Volume& b, Touch& touch);
double box_box(const Volume& a, const Volume& b, Touch& touch);

// See `distance`.
double capsule_box_distance(const Volume& a, const Volume& b);
double capsule_cylinder_distance(const Volume& a, const Volume& b);

// The s, t in [-1, 1] for which w + s u and t v are closest; the middle of the interval if they are parallel.
std::pair<double, double> closest_parameters(Vec3 w, Vec3 u, Vec3 v);

// The contact of two volumes of any kind, from the separation of the first: direction (unit vector, root frame) and length.
Touch touch_along(const Volume& a, const Volume& b, Vec3 normal, double depth);

}  // namespace mobee::narrow
