// The outline of a difference of volumes with one cylinder in it, seen along an edge: where it comes closest to the origin.
//
// Along directions n square to a unit vector e, a disc of radius r across c reaches as far as an ellipse.  Segments add corners,
// a ball or another disc across e adds a circle.  Between the directions where the corner changes (kinks) the outline is smooth.
#pragma once

#include "narrow.hpp"

namespace mobee::narrow {

// The plane across e has the axes (1, 0) and (0, 1).
struct Disc {
    double radius;
    Point beside;  // e x c
    double lean;   // the square of e.c
    double ball;   // radius of the circle that is added
};

// The way that is shortest so far.
struct Exit {
    double reach;
    Point n;
};

// The point of the outline that is farthest along n, the disc being about the origin.
Point bulge(const Disc& disc, Point n);

// Between two directions, less than half a turn apart against the clock, the outline is that of the disc about a corner: take the
// smooth minimum of its reach there if it is shorter by more than `tie`.  The reach at the two has been considered.
void improve_between(const Disc& disc, Point corner, Point from, Point to, Exit& best);

}  // namespace mobee::narrow
