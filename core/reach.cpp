// SPDX-License-Identifier: Apache-2.0
// Where the marker of a reach is, how each motor moves it, and the published force (thesis eqs. 5.1 and 5.5).
#include "reach.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "interface.hpp"

namespace mobee {

namespace reach {

constexpr double degree = 3.14159265358979323846 / 180.0;
// rad/s^2 for a lever and a distance of 1 m, of a normal all of it where it points the other way; the 2014 program's 5000 are deg/s^2
constexpr double gain = 5000.0 * degree;

// Turn a vector about a joint's axis, by an angle of that sine and of the joint's cosine.
Vec3 spin(const ReachJoint& joint, Vec3 v, double sine) {
    const Vec3 once = cross(joint.axis, v);
    return v + sine * once + (1.0 - joint.cosine) * cross(joint.axis, once);
}

// Bring the joints to q; the first that has moved since the last pose.
std::int64_t bend_joints(Reach& reach, const double* q) {
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

// From the marker down to the base: where it is in the frame of what carries each joint, and in the root frame.
void see_marker(Reach& reach) {
    Vec3 marker = reach.point;
    for (std::int64_t j = reach.joints.size - 1; j >= 0; --j) {
        ReachJoint& joint = reach.joints[j];
        marker = joint.slides ? marker + joint.angle * joint.axis : spin(joint, marker - joint.pivot, joint.sine) + joint.pivot;
        joint.seen = marker;
    }
    reach.at = marker;
}

// From the base up, behind the first joint that has moved: the frames in front of each joint.
void turn_frames(Reach& reach, std::int64_t first) {
    for (std::int64_t j = first; j < reach.used - 1; ++j) {
        const ReachJoint& joint = reach.joints[j];
        for (int row = 0; row < 9; row += 3) {
            const double* m = joint.frame.m + row;
            Vec3 turned = {m[0], m[1], m[2]};
            if (!joint.slides) turned = spin(joint, turned, -joint.sine);
            for (int k = 0; k < 3; ++k) reach.joints[j + 1].frame.m[row + k] = turned[k];
        }
    }
}

void face(Reach& reach) {
    Vec3 normal = reach.normal;
    for (std::int64_t j = reach.joints.size - 1; j >= 0; --j)
        if (!reach.joints[j].slides) normal = spin(reach.joints[j], normal, reach.joints[j].sine);
    reach.facing = normal;
}

// How a joint moves and turns the marker.
void move_marker(ReachJoint& joint) {
    const Vec3 axis = out_of(joint.frame, joint.axis);
    const Vec3 arm = out_of(joint.frame, joint.seen - joint.pivot);
    joint.motion = joint.slides ? axis : cross(axis, arm);
    if (!joint.slides) joint.turning = axis;
}

// J^T f before it is bounded, in rad/s^2: f as strong as the marker is far.
void force_motors(Reach& reach) {
    double twist = 0.0;
    if (reach.turned) twist = gain * reach.missing * 0.5 * (1.0 - dot(reach.facing, reach.wanted));
    for (PulledMotor& motor : reach.motors) {
        motor.force = 0.0;
        for (int row = 0; row < 3; ++row)
            motor.force += gain * motor.column[row] * reach.error[row] + twist * motor.column[3 + row] * reach.error[3 + row];
    }
}

// Add L(f) as of a client (see `mobee_law_client`), of the motors that are pulled.
void add_bounded(const Law& law, const Reach& reach, double* total) {
    if (!law.direction) {
        for (const PulledMotor& motor : reach.motors) {
            const MotorGains& gains = law.motors[motor.motor];
            total[motor.motor] += squash(motor.force * gains.unit, gains.max_client, gains.client_knee);
        }
        return;
    }
    double squares = 0.0, most = std::numeric_limits<double>::infinity();
    for (const PulledMotor& motor : reach.motors) squares += motor.force * motor.force;
    const double length = std::sqrt(squares);
    for (const PulledMotor& motor : reach.motors) most = std::min(most, client_share(law.motors[motor.motor], length));
    for (const PulledMotor& motor : reach.motors) total[motor.motor] += most * motor.force * law.motors[motor.motor].unit;
}

}  // namespace reach

void place_marker(Reach& reach, const double* q) {
    const std::int64_t first = reach::bend_joints(reach, q);
    reach::see_marker(reach);
    reach::turn_frames(reach, first);
    if (reach.turned) reach::face(reach);
    for (PulledMotor& motor : reach.motors) std::fill_n(motor.column, 6, 0.0);
    for (std::int64_t j = 0; j < reach.used; ++j) {
        ReachJoint& joint = reach.joints[j];
        if (!joint.pulled) continue;
        reach::move_marker(joint);
        for (std::int64_t k = joint.drives.first; k < joint.drives.end; ++k) {
            const ReachDrive& drive = reach.drives[k];
            if (drive.pulled < 0) continue;
            double* column = reach.motors[drive.pulled].column;
            for (int row = 0; row < 3; ++row) {
                column[row] += drive.lever * joint.motion[row];
                column[3 + row] += drive.lever * joint.turning[row];
            }
        }
    }
}

void note_error(Reach& reach) {
    const Vec3 way = reach.target - reach.at;
    double distance = length(way), kept = 1.0;
    if (reach.surface) {
        const double outside = std::max(distance - reach.radius, 0.0);
        kept = distance > 0.0 ? outside / distance : 0.0;
        distance = outside;
    }
    reach.missing = distance;
    for (int k = 0; k < 3; ++k) reach.error[k] = way[k] * kept;
    if (!reach.turned) return;
    const Vec3 turn = cross(reach.facing, reach.wanted);
    for (int k = 0; k < 3; ++k) reach.error[3 + k] = turn[k];
}

void add_reaches(const Law& law, View<Reach* const> reaches, double* q, const double* attractor, double dt, double* total) {
    for (Reach* reach : reaches) {
        place_marker(*reach, q);
        note_error(*reach);
        bool nudged = false;
        if (law.published) {
            reach::force_motors(*reach);
        } else {
            nudged = pull_marker(law, *reach, q, dt, total);
        }
        reach::add_bounded(law, *reach, total);
        if (!law.published) add_release(law, *reach, nudged, q, attractor, total);
    }
}

bool goes_on(const Law& law, View<Reach* const> reaches, std::int64_t part) {
    for (const Reach* reach : reaches)
        if (reach->part == part) return !law.published && nears(*reach);
    return false;
}

MOBEE_CALL void mobee_reach_add(const Law* law, Reach* const* reaches, std::int64_t count, double* q, const double* attractor, double dt,
                                double* total) {
    add_reaches(*law, {reaches, count}, q, attractor, dt, total);
}

MOBEE_CALL std::int64_t mobee_reach_goes_on(const Law* law, Reach* const* reaches, std::int64_t count, std::int64_t part) {
    return goes_on(*law, {reaches, count}, part);
}

}  // namespace mobee
