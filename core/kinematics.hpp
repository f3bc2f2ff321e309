// Forward kinematics: the product of exponentials over the tree (Gupta's zero reference position, thesis 2.3.1).
#pragma once

#include "robot.hpp"

namespace mobee {

// The angles (joints,) at the motor positions q (motors,).
void joint_angles(const Robot& robot, const double* q, double* angles);

// The sine and 1 - cosine of every angle, within the last bits.
void sines_cosines(const double* angles, std::int64_t count, double* sines, double* cosines);

// The frames (links,) of the links that have `moved` (links,), of all without it; the base stands still.
void place_links(const Robot& robot, const double* angles, const double* sines, const double* cosines, const bool* moved, Frame* links);

// How a point (root frame, now) fixed to a link moves with each motor: adds to `out` (6, motors), linear rows then angular.
void add_jacobian(const Robot& robot, const Frame* links, std::int64_t link, Vec3 point, double* out);

}  // namespace mobee
