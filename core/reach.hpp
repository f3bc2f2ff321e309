// SPDX-License-Identifier: Apache-2.0
// Reaching: the motors of a part pull a marker towards a target (thesis 5.1 and 8.2).
//
// The order of the floating-point operations is fixed, as in the law.  The Jacobian of the marker has three rows (position), or six
// where the marker's normal is turned too.
#pragma once

#include <cstdint>

#include "law.hpp"
#include "vector.hpp"

namespace mobee {

// A motor that drives a joint between base and marker.
struct ReachDrive {
    std::int64_t motor = 0;
    std::int64_t pulled = -1;  // index among the pulled motors; -1 for a motor that is not pulled
    double scale = 0.0;        // motion of the joint for a unit of the motor's position
    double lever = 0.0;        // motion of the joint for 1 rad of the gains: scale * MotorGains::unit; 0 for a motor that is not pulled
};

// A joint between base and marker.
struct ReachJoint {
    std::int64_t slides = 0;  // 1 for a prismatic joint
    std::int64_t pulled = 0;  // whether a pulled motor drives it
    Interval drives;
    Vec3 axis, pivot;         // at zero pose, root frame
    double offset = 0.0;      // position of the joint when its motors are at 0
    // At the last pose:
    double angle = 0.0, sine = 0.0, cosine = 0.0;
    Vec3 marker;           // position of the marker in the frame of the link that carries the joint [m]
    Rotation frame;        // rotation of the link that carries the joint
    Vec3 linear, angular;  // velocity of the marker for unit velocity of the joint, root frame
};

// A motor that pulls the marker.  Its position counts in MotorGains::unit.
struct PulledMotor {
    std::int64_t motor = 0;
    double column[6] = {};  // column of the marker's Jacobian
    double descent = 0.0;   // element of J^T error: the negative gradient of half the squared error, m^2/rad
    double mobility = 0.0;  // velocity for a force of 1; 0 where a limit blocks the motor
    double force = 0.0;     // rad/s^2
    double escape = 0.0, last_escape = 0.0;  // elements of the unit direction out of a singular pose: present, and previous
    double bend_direction = 0.0;             // element of the unit direction along which the marker's path curves most
    double limit_resistance = 0.0;           // size of the limit force if it opposes the pull, else 0
    double obstruction = 0.0;                // the other forces on the motor without the limit force
};

struct Reach {
    std::int64_t part = 0;          // first motor of the part; -1 for a reach of the whole body
    std::int64_t to_surface = 0;    // whether the target is the surface of a ball, else its centre
    std::int64_t turns_normal = 0;  // whether the marker's normal is turned to `target_normal`
    std::int64_t faces_target = 0;  // whether `target_normal` is the direction from the marker to the target
    std::int64_t joint_count = 0;   // number of joints up to the last one that a pulled motor drives
    View<ReachJoint> joints;        // from the base to the marker
    View<const ReachDrive> drives;
    View<PulledMotor> motors;
    double* curvature = nullptr;    // (motors, motors), second derivatives, filled when they are needed
    Vec3 target, target_normal;     // of the target: position and wanted direction of the normal, root frame
    double radius = 0.0;            // m, of the target
    Vec3 point, normal;             // of the marker at zero pose, root frame
    // At the last pose:
    Vec3 marker_position, marker_normal;
    double error[6] = {};   // from marker to target [m], then from the marker's normal to the target's (cross product)
    double distance = 0.0;  // length of the position error [m]
    // State of the default law:
    double smoothed_error[6] = {};       // the error averaged over the noise of the encoders; normals weighted by an arm [m]
    double smoothed_distance = 0.0;      // its length [m]
    double least_distance = 0.0;         // the smallest of these lengths so far [m]
    double time_without_progress = 0.0;  // s, since `least_distance` has decreased
    std::int64_t started = 0;            // whether the state has been initialised
    std::int64_t escapes = 0;            // whether the last pose was singular and the motors follow `escape`

    int rows() const { return turns_normal ? 6 : 3; }
};

// Add the forces of reaches at the measured q (n,) to `total` (n,), which holds the sum of all other forces.  `q` is changed during the
// call and restored.
void add_reaches(const Law& law, View<Reach* const> reaches, double* q, const double* attractor, double dt, double* total);

// Return whether the part whose first motor is `part` reaches and its marker still comes nearer.  False under the published law.
bool is_approaching(const Law& law, View<Reach* const> reaches, std::int64_t part);

// Compute the marker's position and normal and the Jacobian columns of the pulled motors at q.
void place_marker(Reach& reach, const double* q);

// Compute error and distance for the present marker.
void update_error(Reach& reach);

// Fill the motors' forces of the default law, before they are bounded, for a placed marker.  `other_forces` (n,) act on the motors
// besides their springs.  Set `escapes`, and fill `escape` if it is 1.
void compute_pull(const Law& law, Reach& reach, double* q, double dt, const double* other_forces);

// Cancel the springs of the pulled motors in `total`, but not those that a reach `before` has cancelled.  If the reach escapes, add springs
// towards a point along `escape`.
void replace_springs(const Law& law, const Reach& reach, View<Reach* const> before, const double* q, const double* attractor, double* total);

// Return whether the marker has not arrived yet and has come nearer recently.
bool has_progress(const Reach& reach);

}  // namespace mobee
