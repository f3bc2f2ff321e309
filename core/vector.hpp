// SPDX-License-Identifier: Apache-2.0
// Vectors, rotations and frames of three dimensions, as plain numbers.
#pragma once

#include <cmath>

namespace mobee {

struct Vec3 {
    double x = 0.0, y = 0.0, z = 0.0;

    double& operator[](int k) { return k == 0 ? x : k == 1 ? y : z; }
    double operator[](int k) const { return k == 0 ? x : k == 1 ? y : z; }
};

inline Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator-(Vec3 a) { return {-a.x, -a.y, -a.z}; }
inline Vec3 operator*(double s, Vec3 a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(Vec3 a, Vec3 b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(Vec3 a, Vec3 b) { return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x}; }
inline double length(Vec3 a) { return std::sqrt(dot(a, a)); }

// These compile to single instructions, unlike std::min and std::max on some compilers; if a is NaN the result is b.
inline double least(double a, double b) { return a < b ? a : b; }
inline double most(double a, double b) { return a > b ? a : b; }
inline double clamp(double value, double low, double high) { return least(most(value, low), high); }
inline double unit(double value) { return clamp(value, -1.0, 1.0); }

// Row-major: its columns are the axes of the turned body.
struct Rotation {
    double m[9] = {1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0};

    Vec3 column(int k) const { return {m[k], m[3 + k], m[6 + k]}; }
};

// Return v, given in the body's own axes, in the outer axes.
inline Vec3 out_of(const Rotation& r, Vec3 v) {
    return {r.m[0] * v.x + r.m[1] * v.y + r.m[2] * v.z,
            r.m[3] * v.x + r.m[4] * v.y + r.m[5] * v.z,
            r.m[6] * v.x + r.m[7] * v.y + r.m[8] * v.z};
}

// Return v, given in the outer axes, in the body's own axes.
inline Vec3 into(const Rotation& r, Vec3 v) {
    return {r.m[0] * v.x + r.m[3] * v.y + r.m[6] * v.z,
            r.m[1] * v.x + r.m[4] * v.y + r.m[7] * v.z,
            r.m[2] * v.x + r.m[5] * v.y + r.m[8] * v.z};
}

// Four numbers in one register; for a vector, each user defines the fourth number.
typedef double Four __attribute__((vector_size(32)));

inline Vec3 three(Four v) { return {v[0], v[1], v[2]}; }
inline Four four(Vec3 v) { return Four{v.x, v.y, v.z, 0.0}; }

// The motion of a link from its zero pose: the columns of its rotation, and its translation.  The fourth numbers are 0.
struct Frame {
    Four x{1.0, 0.0, 0.0, 0.0}, y{0.0, 1.0, 0.0, 0.0}, z{0.0, 0.0, 1.0, 0.0}, shift{0.0, 0.0, 0.0, 0.0};
};

inline Four turned(const Frame& f, Vec3 v) { return v.x * f.x + v.y * f.y + v.z * f.z; }
inline Four moved(const Frame& f, Vec3 p) { return turned(f, p) + f.shift; }
inline Vec3 turn(const Frame& f, Vec3 v) { return three(turned(f, v)); }
inline Vec3 move(const Frame& f, Vec3 p) { return three(moved(f, p)); }

}  // namespace mobee
