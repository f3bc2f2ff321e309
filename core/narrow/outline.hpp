// SPDX-License-Identifier: Apache-2.0
// The outline of a difference of volumes with a cylinder in it, seen along an edge: where it comes closest to the origin.
//
// Along directions square to a unit vector e, a disc across an axis c reaches as far as an ellipse.  Segments add corners and a disc
// across e adds a circle.  Between the directions where the corner changes (kinks) the outline is smooth.
#pragma once

#include "narrow.hpp"

namespace mobee::narrow {

// A cylinder seen along e, in two axes across it.
struct Disc {
    double radius;
    Point axis;   // c
    Point end;    // half the cylinder's axis
    double lean;  // the square of e.c
    double ball;  // radius of the circle that is added
};

// The shortest way that is known.
struct Exit {
    double reach;
    Point n;
};

// Take the shortest smooth minimum of how far a cylinder, swept along a rectangle about `shift`, reaches, if it is shorter by more
// than `tie` than what is known; the reach at the kinks has been considered.
void improve_around(const Disc& disc, Point shift, Point half, Exit& best);

}  // namespace mobee::narrow
