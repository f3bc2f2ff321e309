// SPDX-License-Identifier: Apache-2.0
// Polygons in the plane perpendicular to a contact's normal.
#pragma once

#include "narrow.hpp"

namespace mobee::narrow {

// Keep, in order, the corners of the convex hull of points; returns their number (Jarvis's march).
int outline(Point* points, int count, double near);

// Write the part of a convex polygon that is not beyond a line, given by a point and its inward normal; returns the number of corners.
// Corners for which `out` has no space are left out: a polygon that is convex only within rounding may be cut more than twice.
int cut(const Point* points, int count, Point on, Point inward, Point* out, int room);

}  // namespace mobee::narrow
