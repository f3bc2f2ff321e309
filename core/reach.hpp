// SPDX-License-Identifier: Apache-2.0
// Reaching: the motors of a part draw a marker to a target, against their attractor (thesis 5.1 and 8.2).
//
// It rounds as it is written, as the law does.  In the frame of the target a Jacobian has three rows, or six where the marker's
// normal is turned too.
#pragma once

#include <cstdint>

#include "law.hpp"
#include "vector.hpp"

namespace mobee {

// A motor that drives a joint between base and marker.
struct ReachDrive {
    std::int64_t motor = 0;
    std::int64_t pulled = -1;  // which of the pulled motors it is, -1 if it is none
    double scale = 0.0;        // by how much it moves the joint,
    double lever = 0.0;        // and that in the unit of the motor
};

// A joint between base and marker.
struct ReachJoint {
    std::int64_t slides = 0;
    std::int64_t pulled = 0;  // a pulled motor drives it
    Interval drives;
    Vec3 axis, pivot;  // at zero pose, root frame
    double offset = 0.0;
    // Of the last pose.  `seen`: the marker in the frame of what carries the joint, and that frame.
    double angle = 0.0, sine = 0.0, cosine = 0.0;
    Vec3 seen;
    Rotation frame;
    Vec3 motion, turning;  // of the marker along the joint, root frame
};

// A motor that is pulled; its numbers in the unit of the motor.
struct PulledMotor {
    std::int64_t motor = 0;
    double column[6] = {};  // of the marker's Jacobian
    double slope = 0.0;     // J^T error: how fast half the square of the error falls, m^2/rad
    double ease = 0.0;      // how fast the motor goes for a torque of 1, 0 where a limit keeps it
    double force = 0.0;
    double way = 0.0, before = 0.0;     // out of a singular pose, now and the last time
    double bent = 0.0;                  // along which the marker's path bends most
    double limited = 0.0, held = 0.0;   // how strongly its limit holds it back, and what else does
};

struct Reach {
    std::int64_t part = 0;  // the first motor of the part
    std::int64_t surface = 0, turned = 0;  // what is asked for: the target's surface; the marker's normal
    std::int64_t used = 0;  // joints up to the last that a pulled motor drives
    View<ReachJoint> joints;
    View<const ReachDrive> drives;
    View<PulledMotor> motors;
    double* curve = nullptr;  // (motors, motors): how J^T of the error, or of the force, changes with each motor
    Vec3 target, wanted;      // where the marker is to be, where its normal is to point; root frame
    double radius = 0.0;      // m, of the target
    Vec3 point, normal;       // of the marker at zero pose, root frame
    // Of the last pose: marker, its normal, what is missing (to the target in m, and to the normal), and its length [m].
    Vec3 at, facing;
    double error[6] = {};
    double missing = 0.0;
    // What the default law remembers: what is missing without the encoders' noise, its length [m], the least so far [m] and for how
    // long [s].
    double seen[6] = {};
    double left = 0.0, best = 0.0, since = 0.0;
    std::int64_t begun = 0;

    int rows() const { return turned ? 6 : 3; }
};

// Add the forces of reaches at the measured q (n,) to `total` (n,), which has all others.  `q` is the same afterwards.
void add_reaches(const Law& law, View<Reach* const> reaches, double* q, const double* attractor, double dt, double* total);

// Whether the part that begins with that motor reaches, and goes on although it has settled; never under the published law.
bool goes_on(const Law& law, View<Reach* const> reaches, std::int64_t part);

// Bring the marker, and the columns of the motors that are pulled, to q; then what is missing.
void place_marker(Reach& reach, const double* q);
void note_error(Reach& reach);

// Fill the motors' forces, before they are bounded, of a marker that is in place; whether `way` leads out of this pose.  `against`
// (n,): what else acts on the motors than their springs.
bool pull_marker(const Law& law, Reach& reach, double* q, double dt, const double* against);

// Take the springs of the motors that are pulled away from `total`, and where they are `nudged` draw them a little along `way`.
void add_release(const Law& law, const Reach& reach, bool nudged, const double* q, const double* attractor, double* total);

// Whether the marker is not there yet and still comes nearer.
bool nears(const Reach& reach);

}  // namespace mobee
