// SPDX-License-Identifier: Apache-2.0
// Pairs of spheres and capsules: each is a point or a segment, inflated by a radius.
#include "narrow.hpp"

namespace mobee::narrow {

namespace rounded {

constexpr double parallel = 1e-12;  // sin^2 of the angle below which segments count as parallel
constexpr double brief = 1e-24;     // m^2: the square of a half length below which a capsule counts as a sphere

// The contact of two rounded volumes whose cores are closest at s and t.
Touch contact_at(const Volume& a, const Volume& b, Vec3 normal, double s, double t) {
    return {normal, 0.5 * (a.center + s * a.core + b.center + t * b.core + (b.radius - a.radius) * normal)};
}

// A unit vector perpendicular to two crossing segments (if both are on one line: the longer one's own x axis).
Vec3 across(const Volume& a, const Volume& b) {
    const Vec3 n = cross(a.core, b.core);
    const double squared = dot(n, n), aa = dot(a.core, a.core), bb = dot(b.core, b.core);
    if (squared <= most(parallel * aa * bb, brief * brief)) return (aa >= bb ? a : b).rotation.column(0);
    return over(n, std::sqrt(squared));
}

}  // namespace rounded

double sphere_sphere(const Volume& a, const Volume& b, Touch& touch) {
    const Vec3 w = a.center - b.center;
    const double squared = dot(w, w), reach = a.radius + b.radius, distance = std::sqrt(squared);
    if (squared >= reach * reach) return reach - distance;
    const Vec3 normal = distance < touching ? a.rotation.column(2) : over(w, distance);
    touch = rounded::contact_at(a, b, normal, 0.0, 0.0);
    return reach - distance;
}

double sphere_capsule(const Volume& a, const Volume& b, Touch& touch) {
    Vec3 w = a.center - b.center;
    const double t = unit(dot(b.core, w) / most(dot(b.core, b.core), rounded::brief));
    w = w - t * b.core;
    const double squared = dot(w, w), reach = a.radius + b.radius, distance = std::sqrt(squared);
    if (squared >= reach * reach) return reach - distance;
    const Vec3 normal = distance < touching ? b.rotation.column(0) : over(w, distance);
    touch = rounded::contact_at(a, b, normal, 0.0, t);
    return reach - distance;
}

double capsule_capsule(const Volume& a, const Volume& b, Touch& touch) {
    Vec3 w = a.center - b.center;
    const auto [s, t] = closest_parameters(w, a.core, b.core);
    w = w + s * a.core - t * b.core;
    const double squared = dot(w, w), reach = a.radius + b.radius, distance = std::sqrt(squared);
    if (squared >= reach * reach) return reach - distance;
    const Vec3 normal = distance < touching ? rounded::across(a, b) : over(w, distance);
    touch = rounded::contact_at(a, b, normal, s, t);
    return reach - distance;
}

std::pair<double, double> closest_parameters(Vec3 w, Vec3 u, Vec3 v) {
    const double a = dot(u, u), e = dot(v, v), b = dot(u, v), c = dot(u, w), f = dot(v, w);
    const double sine = a * e - b * b, both = a * e;
    double s = 0.0;
    if (sine > rounded::parallel * both) {
        s = unit((b * f - c * e) / sine);
    } else if (a > rounded::brief && e > rounded::brief) {
        // The ends of v, measured along u.
        const double first = (-e - f) / b, last = (e - f) / b;
        s = (most(least(first, last), -1.0) + least(most(first, last), 1.0)) / 2.0;
    }
    const double t = unit((b * unit(s) + f) / most(e, rounded::brief));
    return {unit((b * t - c) / most(a, rounded::brief)), t};
}

}  // namespace mobee::narrow
