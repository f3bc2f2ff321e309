// SPDX-License-Identifier: Apache-2.0
// The smallest distance from the origin of the outline, seen along an edge, of a difference of volumes one of which is a cylinder.
//
// Along directions perpendicular to a unit vector e, a disc across an axis c has the reach of an ellipse.  Segments add corners and a disc
// across e adds a circle.  Between the directions where the corner changes (kinks) the outline is smooth.
#pragma once

#include "narrow.hpp"

namespace mobee::narrow {

// A cylinder seen along e, in two axes perpendicular to e.
struct Disc {
    double radius;
    Point axis;   // c
    Point end;    // half the cylinder's axis
    double lean;  // the square of e.c
    double ball;  // radius of the added circle
};

// The smallest separation known so far.
struct Exit {
    double reach;
    Point n;
};

// Replace the known separation by the smallest smooth minimum of the reach of a cylinder, swept along a rectangle about `shift`, if that
// is smaller by more than `tie`; the reach at the kinks has been considered before.
void improve_around(const Disc& disc, Point shift, Point half, Exit& best);

}  // namespace mobee::narrow
