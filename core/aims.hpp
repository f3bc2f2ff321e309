// SPDX-License-Identifier: Apache-2.0
// The aims of least squares, and their derivatives by the motor positions.
#pragma once

#include <cstdint>

#include "kinematics.hpp"
#include "robot.hpp"

namespace mobee {

// Numbered as in mobee/roadmap/ik/terms.py.
enum class AimKind : std::int64_t {
    place,       // the two points coincide
    turned,      // the two frames are parallel
    along,       // the two directions are equal
    hold,        // the points are a length apart
    facing,      // the first direction points to the second point
    coordinate,  // the first point is `length` further than the second along a direction of the root frame, which may have any length
    at_most,     // the same, or less
    motor,       // a motor is at a value, the length
};

// An aim binds a first link to a second one, which is the base, link 0, for aims in the root frame.
struct Aim {
    AimKind kind;
    std::int64_t first, second;
    std::int64_t motor;
};

// The goal of an aim, in the root frame at zero pose.  A direction is the first three numbers of its frame.
struct Goal {
    Vec3 first_point;
    Rotation first_frame;
    Vec3 second_point;
    Rotation second_frame;
    double length, tolerance;
};

// An aim in one pose.
struct Sight {
    Vec3 first, second;      // positions of the points
    Vec3 direction, wanted;  // the directions that are to become equal
    Vec3 missing;            // the error [m or rad]; an aim of one row uses the first number only
};

// The number of rows that an aim has in least squares.
inline std::int64_t rows_of(AimKind kind) {
    return kind == AimKind::place || kind == AimKind::turned || kind == AimKind::along || kind == AimKind::facing ? 3 : 1;
}

// Whether the error of an aim is an angle.
inline bool is_turn(AimKind kind) {
    return kind == AimKind::turned || kind == AimKind::along || kind == AimKind::facing || kind == AimKind::motor;
}

// Evaluate an aim at motor positions q (motors,) and link frames (links,); returns the size of its error [m or rad].
double see(const Aim& aim, const Goal& goal, const double* q, const Frame* frames, Sight& sight);

// The rows of least squares: the derivatives of the errors by the motors that may move.
struct Slopes {
    const std::int64_t* column;  // (motors,): index among the motors that may move; -1: the motor does not move
    double turn;                 // m/rad: weight of an error of direction relative to one of position
    std::int64_t stride;         // distance of two rows in memory
    double* rows;
};

// Add the rows of an aim at its last evaluation, from index `row` on; they must hold 0 before.
void add_slopes(const Robot& robot, const Aim& aim, const Sight& sight, const Frame* frames, std::int64_t row, const Slopes& slopes);

}  // namespace mobee
