// SPDX-License-Identifier: Apache-2.0
#include "aims.hpp"

#include <cmath>

namespace mobee {

namespace aiming {

inline Vec3 direction_in(const Rotation& frame) { return {frame.m[0], frame.m[1], frame.m[2]}; }

// Compute the smallest rotation vector [rad] from a unit vector to another; returns its angle.
double turn_between(Vec3 from, Vec3 to, Vec3& turn) {
    Vec3 axis = cross(from, to);
    double sine = length(axis);
    const double angle = std::atan2(sine, dot(from, to));
    if (sine < 1e-9 && angle > 1.0) {  // opposite: any perpendicular axis
        axis = std::fabs(from.x) < 0.7 ? Vec3{0.0, from.z, -from.y} : Vec3{-from.z, 0.0, from.x};
        sine = length(axis);
    }
    turn = (sine > 1e-12 ? angle / sine : 1.0) * axis;
    return angle;
}

// Compute the rotation vector [rad] from the first frame to the second; returns its angle.
double turn_of_frames(const Goal& goal, const Frame& first, const Frame& second, Vec3& turn_found) {
    Vec3 x, y, z;  // the rows of the rotation B A^T, summed over the columns of the frames
    for (int c = 0; c < 3; ++c) {
        const Vec3 a = turn(first, goal.first_frame.column(c)), b = turn(second, goal.second_frame.column(c));
        x = x + b.x * a;
        y = y + b.y * a;
        z = z + b.z * a;
    }
    Vec3 axis{z.y - y.z, x.z - z.x, y.x - x.y};
    const double sine = 0.5 * length(axis), cosine = 0.5 * (x.x + y.y + z.z - 1.0);
    const double angle = std::atan2(sine, cosine);
    if (sine < 1e-7 && cosine < 0.0) {  // half a turn: the axis is the longest column of R + I
        if (x.x >= y.y && x.x >= z.z) {
            axis = {x.x + 1.0, y.x, z.x};
        } else if (y.y >= z.z) {
            axis = {x.y, y.y + 1.0, z.y};
        } else {
            axis = {x.z, y.z, z.z + 1.0};
        }
    }
    const double size = length(axis);
    turn_found = (size > 1e-12 ? angle / size : 0.5) * axis;
    return angle;
}

// The motion of the bodies that a joint carries, for one unit of a motor.
struct Move {
    Vec3 turn;  // rotation of frames
    Vec3 shift;   // translation of the aim's point
};

// The decrease of an aim's error when a joint moves its first side (sign 1) or its second (sign -1).
Vec3 slope_of(AimKind kind, double sign, const Move& move, const Sight& sight) {
    const Vec3 apart = sight.second - sight.first;
    switch (kind) {
        case AimKind::place:
            return sign * move.shift;
        case AimKind::hold:
            return {sign * dot(apart, move.shift) / most(length(apart), 1e-9), 0.0, 0.0};
        case AimKind::coordinate:
        case AimKind::at_most:
            return {sign * dot(sight.direction, move.shift), 0.0, 0.0};
        default:
            break;
    }
    Vec3 turn = sign * move.turn;
    if (kind == AimKind::facing) {
        // The direction to the second point turns by (point to point) x (velocity of the second) / distance^2.
        const Vec3 swing = (sign / most(dot(apart, apart), 1e-12)) * cross(apart, move.shift);
        turn = sign > 0.0 ? turn + swing : swing;
    }
    if (kind == AimKind::turned) return turn;
    return turn - dot(turn, sight.direction) * sight.direction;  // a rotation about the direction itself does not change it
}

}  // namespace aiming

double see(const Aim& aim, const Goal& goal, const double* q, const Frame* frames, Sight& sight) {
    const Frame &first = frames[aim.first], &second = frames[aim.second];
    sight.first = move(first, goal.first_point);
    sight.second = move(second, goal.second_point);
    const Vec3 apart = sight.second - sight.first;
    switch (aim.kind) {
        case AimKind::place:
            sight.missing = apart;
            return length(apart);
        case AimKind::turned:
            return aiming::turn_of_frames(goal, first, second, sight.missing);
        case AimKind::hold:
            sight.missing = {length(apart) - goal.length, 0.0, 0.0};
            return std::fabs(sight.missing.x);
        case AimKind::coordinate:
        case AimKind::at_most: {
            const Vec3 direction = aiming::direction_in(goal.second_frame);
            const double missing = goal.length + dot(direction, apart);
            const double counts = aim.kind == AimKind::coordinate || missing < 0.0 ? 1.0 : 0.0;
            sight.direction = counts * direction;
            sight.missing = {counts * missing, 0.0, 0.0};
            return std::fabs(sight.missing.x);
        }
        case AimKind::motor:
            sight.missing = {goal.length - q[aim.motor], 0.0, 0.0};
            return std::fabs(sight.missing.x);
        case AimKind::along:
            sight.wanted = turn(second, aiming::direction_in(goal.second_frame));
            break;
        case AimKind::facing:
            sight.wanted = (1.0 / most(length(apart), 1e-9)) * apart;
            break;
    }
    sight.direction = turn(first, aiming::direction_in(goal.first_frame));
    return aiming::turn_between(sight.direction, sight.wanted, sight.missing);
}

void add_slopes(const Robot& robot, const Aim& aim, const Sight& sight, const Frame* frames, std::int64_t row, const Slopes& slopes) {
    double* rows = slopes.rows + row * slopes.stride;
    if (aim.kind == AimKind::motor) {
        if (slopes.column[aim.motor] >= 0) rows[slopes.column[aim.motor]] = slopes.turn;
        return;
    }
    const double weight = is_turn(aim.kind) ? slopes.turn : 1.0;
    const std::int64_t count = rows_of(aim.kind);
    for (const bool is_first : {true, false}) {
        const Vec3 point = is_first ? sight.first : sight.second;
        for (std::int64_t link = is_first ? aim.first : aim.second; link > 0; link = robot.joint[link - 1].parent) {
            const Joint& joint = robot.joint[link - 1];
            const Vec3 axis = turn(frames[link], joint.axis);
            const Vec3 shift = joint.slides ? axis : cross(axis, point - move(frames[link], joint.point));
            const aiming::Move moved{joint.slides ? Vec3{} : axis, shift};
            const Vec3 slope = weight * aiming::slope_of(aim.kind, is_first ? 1.0 : -1.0, moved, sight);
            for (std::int64_t drive = 0; drive < robot.drives; ++drive) {
                const std::int64_t k = drive * robot.joints + link - 1, column = slopes.column[robot.motor[k]];
                if (column < 0) continue;
                for (int r = 0; r < count; ++r) rows[r * slopes.stride + column] += robot.scale[k] * slope[r];
            }
        }
    }
}

}  // namespace mobee
