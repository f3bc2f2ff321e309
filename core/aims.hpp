// SPDX-License-Identifier: Apache-2.0
// What least squares can aim at, and how it changes with the motors.
#pragma once

#include <cstdint>

#include "kinematics.hpp"
#include "robot.hpp"

namespace mobee {

// Numbered as in mobee/roadmap/ik/terms.py.
enum class AimKind : std::int64_t {
    place,       // the two points are one
    turned,      // the two frames are parallel
    along,       // the two directions are one
    hold,        // the points are a length apart
    facing,      // the first direction points to the second point
    coordinate,  // the first point is a length further than the second in a direction of the root frame, of any length itself
    at_most,     // it is no further than that
    motor,       // a motor is at a value, the length
};

// An aim binds a first link to a second one, which is the base, link 0, for aims in the root frame.
struct Aim {
    AimKind kind;
    std::int64_t first, second;
    std::int64_t motor;
};

// What an aim wants, in the root frame at zero pose.  Of a direction, the first three numbers of its frame count.
struct Goal {
    Vec3 first_point;
    Rotation first_frame;
    Vec3 second_point;
    Rotation second_frame;
    double length, tolerance;
};

// An aim in one pose.
struct Sight {
    Vec3 first, second;      // where the points are
    Vec3 direction, wanted;  // the directions that are to be made one
    Vec3 missing;            // [m or rad]: of aims for one number, the first counts
};

// How many numbers an aim is for: these stand in so many rows of least squares.
inline std::int64_t rows_of(AimKind kind) {
    return kind == AimKind::place || kind == AimKind::turned || kind == AimKind::along || kind == AimKind::facing ? 3 : 1;
}

// Whether what it misses is an angle.
inline bool is_turn(AimKind kind) {
    return kind == AimKind::turned || kind == AimKind::along || kind == AimKind::facing || kind == AimKind::motor;
}

// Look at an aim where the motors (motors,) are at q and the links (links,) at their frames; returns what is missing of it [m or rad].
double see(const Aim& aim, const Goal& goal, const double* q, const Frame* frames, Sight& sight);

// The rows of least squares: how aims come nearer with the motors that may move.
struct Slopes {
    const std::int64_t* column;  // (motors,): which of those that may move, -1: it stays
    double turn;                 // m/rad: what an error of direction counts beside one of place
    std::int64_t stride;         // from row to row
    double* rows;
};

// Add the rows of an aim where it was seen last; they begin at `row`, and hold 0 before.
void add_slopes(const Robot& robot, const Aim& aim, const Sight& sight, const Frame* frames, std::int64_t row, const Slopes& slopes);

}  // namespace mobee
