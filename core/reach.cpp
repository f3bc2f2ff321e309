// SPDX-License-Identifier: Apache-2.0
// The position and Jacobian of a reach's marker, and the published force on it (thesis eqs. 5.1 and 5.5).
#include "reach.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "interface.hpp"

namespace mobee {

namespace reach {

constexpr double degree = 3.14159265358979323846 / 180.0;
// rad/s^2 for a lever of 1 m and a distance of 1 m; a normal gets the full value if it is opposite to the target's.  The 2014 program has
// 5000 deg/s^2.
constexpr double gain = 5000.0 * degree;
constexpr double facing_distance = 0.02;  // m from the target's centre, within which a marker is turned less and less towards it

// Rotate v about the axis of a joint, by the angle with the given sine and the joint's cosine.
Vec3 rotate_about(const ReachJoint& joint, Vec3 v, double sine) {
    const Vec3 perpendicular = cross(joint.axis, v);
    return v + sine * perpendicular + (1.0 - joint.cosine) * cross(joint.axis, perpendicular);
}

// Set the joint angles for q.  Return the first joint, from the base, that has moved since the last pose.
std::int64_t update_angles(Reach& reach, const double* q) {
    std::int64_t first = reach.joints.size;
    for (std::int64_t j = reach.joints.size - 1; j >= 0; --j) {
        ReachJoint& joint = reach.joints[j];
        double angle = joint.offset;
        for (std::int64_t k = joint.drives.first; k < joint.drives.end; ++k) angle += reach.drives[k].scale * q[reach.drives[k].motor];
        if (angle == joint.angle) continue;
        first = j;
        joint.angle = angle;
        joint.sine = joint.slides ? 0.0 : std::sin(angle);
        joint.cosine = joint.slides ? 1.0 : std::cos(angle);
    }
    return first;
}

// Compute the marker's position in the frame of each joint's parent link, from the marker to the base, and in the root frame.
void locate_marker(Reach& reach) {
    Vec3 marker = reach.point;
    for (std::int64_t j = reach.joints.size - 1; j >= 0; --j) {
        ReachJoint& joint = reach.joints[j];
        marker = joint.slides ? marker + joint.angle * joint.axis : rotate_about(joint, marker - joint.pivot, joint.sine) + joint.pivot;
        joint.marker = marker;
    }
    reach.marker_position = marker;
}

// Compute the rotation of each joint's parent link, from the base on, for the joints after the first that has moved.
void update_frames(Reach& reach, std::int64_t first) {
    for (std::int64_t j = first; j < reach.joint_count - 1; ++j) {
        const ReachJoint& joint = reach.joints[j];
        for (int row = 0; row < 9; row += 3) {
            const double* m = joint.frame.m + row;
            Vec3 turned = {m[0], m[1], m[2]};
            if (!joint.slides) turned = rotate_about(joint, turned, -joint.sine);
            for (int k = 0; k < 3; ++k) reach.joints[j + 1].frame.m[row + k] = turned[k];
        }
    }
}

void update_normal(Reach& reach) {
    Vec3 normal = reach.normal;
    for (std::int64_t j = reach.joints.size - 1; j >= 0; --j)
        if (!reach.joints[j].slides) normal = rotate_about(reach.joints[j], normal, reach.joints[j].sine);
    reach.marker_normal = normal;
}

// Compute the linear and angular velocity of the marker for unit velocity of a joint.
void update_joint_motion(ReachJoint& joint) {
    const Vec3 axis = out_of(joint.frame, joint.axis);
    const Vec3 arm = out_of(joint.frame, joint.marker - joint.pivot);
    joint.linear = joint.slides ? axis : cross(axis, arm);
    if (!joint.slides) joint.angular = axis;
}

// Compute the motors' forces J^T f [rad/s^2] before they are bounded.  f is proportional to the error.
void force_motors(Reach& reach) {
    double normal_force = 0.0;
    if (reach.turns_normal) normal_force = gain * reach.distance * 0.5 * (1.0 - dot(reach.marker_normal, reach.target_normal));
    for (PulledMotor& motor : reach.motors) {
        motor.force = 0.0;
        for (int row = 0; row < 3; ++row)
            motor.force += gain * motor.column[row] * reach.error[row] + normal_force * motor.column[3 + row] * reach.error[3 + row];
    }
}

// Bound the forces of the pulled motors as a client's force (see `mobee_law_client`) and add them to `total` (n,).
void add_bounded(const Law& law, const Reach& reach, double* total) {
    if (!law.keeps_direction) {
        for (const PulledMotor& motor : reach.motors) {
            const MotorGains& gains = law.motors[motor.motor];
            total[motor.motor] += squash(motor.force * gains.unit, gains.max_client, gains.client_knee);
        }
        return;
    }
    double squares = 0.0, least_scale = std::numeric_limits<double>::infinity();
    for (const PulledMotor& motor : reach.motors) squares += motor.force * motor.force;
    const double length = std::sqrt(squares);
    for (const PulledMotor& motor : reach.motors) least_scale = std::min(least_scale, client_scale(law.motors[motor.motor], length));
    for (const PulledMotor& motor : reach.motors) total[motor.motor] += least_scale * motor.force * law.motors[motor.motor].unit;
}

}  // namespace reach

void place_marker(Reach& reach, const double* q) {
    const std::int64_t first = reach::update_angles(reach, q);
    reach::locate_marker(reach);
    reach::update_frames(reach, first);
    if (reach.turns_normal) reach::update_normal(reach);
    for (PulledMotor& motor : reach.motors) std::fill_n(motor.column, 6, 0.0);
    for (std::int64_t j = 0; j < reach.joint_count; ++j) {
        ReachJoint& joint = reach.joints[j];
        if (!joint.pulled) continue;
        reach::update_joint_motion(joint);
        for (std::int64_t k = joint.drives.first; k < joint.drives.end; ++k) {
            const ReachDrive& drive = reach.drives[k];
            if (drive.pulled < 0) continue;
            double* column = reach.motors[drive.pulled].column;
            for (int row = 0; row < 3; ++row) {
                column[row] += drive.lever * joint.linear[row];
                column[3 + row] += drive.lever * joint.angular[row];
            }
        }
    }
}

void update_error(Reach& reach) {
    const Vec3 offset = reach.target - reach.marker_position;
    double distance = length(offset), share = 1.0;
    if (reach.to_surface) {
        const double outside = std::max(distance - reach.radius, 0.0);
        share = distance > 0.0 ? outside / distance : 0.0;
        distance = outside;
    }
    reach.distance = distance;
    for (int k = 0; k < 3; ++k) reach.error[k] = offset[k] * share;
    if (!reach.turns_normal) return;
    double near = 1.0;  // less than 1 close to the target's centre, where a direction to it is not defined
    if (reach.faces_target) {
        const double apart = length(offset);
        near = std::min(1.0, apart / reach::facing_distance);
        if (apart > 0.0) reach.target_normal = (1.0 / apart) * offset;
    }
    const Vec3 turn = cross(reach.marker_normal, reach.target_normal);
    for (int k = 0; k < 3; ++k) reach.error[3 + k] = near * turn[k];
}

void add_reaches(const Law& law, View<Reach* const> reaches, double* q, const double* attractor, double dt, double* total) {
    for (Reach* reach : reaches) {
        place_marker(*reach, q);
        update_error(*reach);
        if (law.published) {
            reach::force_motors(*reach);
        } else {
            compute_pull(law, *reach, q, dt, total);
        }
        reach::add_bounded(law, *reach, total);
    }
    if (law.published) return;
    for (Reach* const* reach = reaches.begin(); reach != reaches.end(); ++reach)
        replace_springs(law, **reach, {reaches.data, reach - reaches.begin()}, q, attractor, total);
}

bool is_approaching(const Law& law, View<Reach* const> reaches, std::int64_t part) {
    for (const Reach* reach : reaches)
        if (reach->part == part) return !law.published && has_progress(*reach);
    return false;
}

MOBEE_CALL void mobee_reach_add(const Law* law, Reach* const* reaches, std::int64_t count, double* q, const double* attractor, double dt,
                                double* total) {
    add_reaches(*law, {reaches, count}, q, attractor, dt, total);
}

MOBEE_CALL std::int64_t mobee_reach_is_approaching(const Law* law, Reach* const* reaches, std::int64_t count, std::int64_t part) {
    return is_approaching(*law, {reaches, count}, part);
}

}  // namespace mobee
