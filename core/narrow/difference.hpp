// SPDX-License-Identifier: Apache-2.0
// The support function of the Minkowski difference b - a of two cores (volumes without their rounding), in the first one's axes.
//
// Moving a along n by the largest n.d over all points d of the difference separates the two by a plane.
#pragma once

#include "narrow.hpp"

namespace mobee::narrow {

struct Reach {
    double low, high;
};

struct Difference {
    const Volume& first;
    const Volume& second;
    Vec3 shift;     // position of the second, in the first's axes
    Rotation turn;  // rotation of the second, in the first's axes
    std::int32_t corner_of_first = -1, corner_of_second = -1;  // for hulls: the corner found last, where the next search starts

    Difference(const Volume& a, const Volume& b);

    // The point of the difference that is farthest along n, in the first's axes.
    Vec3 farthest(Vec3 n);

    // The interval of the difference along n.
    Reach along(Vec3 n) const;

    // A lower bound of the distance of the two cores; 0 if they overlap.
    double apart();
};

// Return whether the point, or the centre of one volume, is inside both; for boxes and cylinders.
bool known_to_meet(const Volume& a, const Volume& b, Vec3 point);

// Return a lower bound of the smallest separation of two cylinders or boxes, from a known separation; 0 if that gives no bound.
double separation_bound(const Volume& a, const Volume& b, const Touch& touch, double length);

struct Nearest {
    double distance;
    Vec3 point;
};

// Return the distance of two cores [m], 0 if they overlap, and the point of their difference closest to the origin, in the first's axes.
// Once the distance is known to be larger than `limit`, a lower bound that is also larger.
Nearest closest(Difference& difference, double limit);

struct Separation {
    double reach;
    Vec3 direction;
};

// Return the smallest reach over all directions [m] of a difference that contains the origin, and its direction, in the first's axes.
// A separation that is known already is kept unless another one is smaller by more than `tie`.
Separation least_separation(Difference& difference, Separation known);

}  // namespace mobee::narrow
