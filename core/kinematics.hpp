// SPDX-License-Identifier: Apache-2.0
// Forward kinematics: the product of exponentials over the tree (Gupta's zero reference position, thesis 2.3.1).
#pragma once

#include "robot.hpp"

namespace mobee {

// The links of a robot in one pose.
struct Links {
    Array<double> angles;  // (joints,) rad or m
    Array<double> s, c;    // (joints,): coefficients of each joint's motion, see `Joint`
    Array<Frame> frame;    // (links,); that of the base is never written

    void fit(const Robot& robot);
};

// Fill the joint angles (joints,) at the motor positions q (motors,).
void joint_angles(const Robot& robot, const double* q, double* angles);

// Fill the sine and 1 - cosine of every angle, to a few last bits.
void sines_cosines(const double* angles, std::int64_t count, double* sines, double* cosines);

// Compute the frames, at the joint angles, of the links that have `moved` (links,); of all links if it is null.
void place_links(const Robot& robot, const bool* moved, Links& links);

// Compute all frames at q (motors,).
void place_links_at(const Robot& robot, const double* q, Links& links);

// Add the Jacobian of a point that is fixed to a link (root frame, present pose) to `out` (6, motors): linear rows, then angular.
void add_jacobian(const Robot& robot, const Frame* frames, std::int64_t link, Vec3 point, double* out);

}  // namespace mobee
