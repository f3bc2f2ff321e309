// SPDX-License-Identifier: Apache-2.0
// The Minkowski difference b - a of two cores (volumes without their rounding), seen from the first: its support function.
//
// Moving a along n by the largest n.d over all d of the difference puts a plane between the two.
#pragma once

#include "narrow.hpp"

namespace mobee::narrow {

struct Reach {
    double low, high;
};

struct Difference {
    const Volume& first;
    const Volume& second;
    Vec3 shift;     // where the second is, seen from the first
    Rotation turn;  // how it is turned
    std::int32_t corner_of_first = -1, corner_of_second = -1;  // of hulls: found last, where the next search starts

    Difference(const Volume& a, const Volume& b);

    // The point of the difference that is farthest along n, in the first's axes.
    Vec3 farthest(Vec3 n);

    // From where to where it reaches along n.
    Reach along(Vec3 n) const;

    // A lower bound of how far the two cores are apart; 0 if they meet.
    double apart();
};

// Whether a point, or the centre of one, is inside both; of boxes and cylinders.
bool known_to_meet(const Volume& a, const Volume& b, Vec3 point);

// A lower bound of how far two cylinders or boxes must move to part, as a way out of known length tells; 0 if it tells nothing.
double least_way_out(const Volume& a, const Volume& b, const Touch& way, double length);

struct Nearest {
    double distance;
    Vec3 point;
};

// The distance of two cores [m] and the closest point of their difference to the origin, in the first's axes; 0 if they overlap.
// Once the distance is known to be larger than `limit`, a lower bound of it that is larger, too.
Nearest closest(Difference& difference, double limit);

struct Way {
    double reach;
    Vec3 direction;
};

// The least reach of a difference that holds the origin, over all directions [m], and that direction, in the first's axes.
// A way that is known already stays unless another is shorter by more than `tie`.
Way way_out(Difference& difference, Way known);

}  // namespace mobee::narrow
