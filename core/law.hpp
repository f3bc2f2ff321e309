// SPDX-License-Identifier: Apache-2.0
// The control law: a spring towards the attractor, damping, and the forces that constrain the robot (thesis eq. 5.7).
//
// The order of the floating-point operations is fixed: a Python program with the same operations in this order gets equal bits.
// Positions are in the unit of the motor: rad for a motor that turns, m for a motor that slides.  The gains are given for motors that
// turn.  `unit` converts them for a motor that slides.  n is the number of motors.
#pragma once

#include <cmath>
#include <cstdint>

#include "array.hpp"

namespace mobee {

// The quantity that a motor is commanded.
enum Modality : std::int64_t { position_modality, velocity_modality, torque_modality };

// The model of a torque-commanded motor: inertia * dv/dt = torque - friction * v.
constexpr double motor_inertia = 0.5;   // kg m^2
constexpr double motor_friction = 5.0;  // N m s/rad

// The gains and limits of one motor, in the unit of the motor.
struct MotorGains {
    double low = 0.0, high = 0.0;                    // position limits
    double max_spring = 0.0, spring_knee = 0.0;      // bound of the spring's force, and the distance at which it is half of the bound
    double damping = 0.0;                            // 1/s
    double limit_slope = 0.0;                        // 1/s^2, stiffness of the limit force
    double low_zone = 0.0, high_zone = 0.0;          // widths of the zones before the limits in which the limit force acts
    double client_slope = 0.0, max_client = 0.0, client_knee = 0.0;  // of a client's force: slope of the squash at 0, bound, knee
    double max_speed = 0.0, max_acceleration = 0.0, max_torque = 0.0;
    double max_lead = 0.0;     // largest distance by which the position reference leads a blocked motor
    double unit = 1.0;         // the length in the motor's unit that corresponds to 1 rad in the gains; 1 for a motor that turns
    double settle_unit = 1.0;  // the length in the motor's unit that corresponds to 1 rad in the settle thresholds
};

// A half-space a.q + b > 0 of a clause.  Its force begins where a.q + b falls below `zone`.
struct ClauseRow {
    double offset = 0.0, zone = 0.0;  // b, and the threshold
    Interval entries;                 // the nonzero elements of a
};

// A nonzero element of a: its motor, its value, and the element of the unit normal of the row, in which each motor counts in `unit`.
struct ClauseEntry {
    std::int64_t motor = 0;
    double factor = 0.0, normal = 0.0;
};

// The thresholds of the settle test: largest speed and acceleration of a settled motor, and times [s].
struct Settle {
    double speed = 0.0, acceleration = 0.0, first_check = 0.0, interval = 0.0, timeout = 0.0;
};

// The state of a settle test: when the action started, and the time of the next check [s].
struct SettleTest {
    double start = 0.0, next_check = 0.0;
};

enum Verdict : std::int64_t { moving, settled, timed_out };

// The law of one robot.
struct Law {
    View<const MotorGains> motors;           // (n,)
    View<const std::int64_t> active;         // indices of the motors that may be moved
    View<const std::int64_t> constrained;    // indices of the motors on which forces are computed
    View<const Interval> parts;              // the motors of each part
    View<const Interval> clauses;            // the rows of each clause
    View<const ClauseRow> rows;
    View<const ClauseEntry> entries;
    std::int64_t published = 0;              // whether the forces are those of the 2014 program
    std::int64_t contact_forces = 0;         // whether contacts cause forces
    std::int64_t keeps_direction = 0;        // whether a client's force is bounded by its norm in each part, else motor by motor
    std::int64_t modality = velocity_modality;
    double max_constraint = 0.0;             // bound of the force of clauses
    double contact_gain = 0.0, contact_slope = 0.0, max_contact = 0.0;  // of the force of contacts: gain, slope of the squash, bound
    Settle settle;
};

// The state of one motor under the law.  `velocity` is the law's own velocity, `commanded` the velocity of the last command.
// `reference` is the position reference, and `feedforward` is added to a torque command [N m].  `goal_velocity` is the velocity of an
// attractor that moves, valid for `goal_time` [s].
struct LawState {
    double velocity = 0.0, acceleration = 0.0, commanded = 0.0, reference = 0.0, feedforward = 0.0;
    double goal_velocity = 0.0, goal_time = 0.0;
};

// The input of the forces: the measured positions q (n,), the sum of J^T (depth * normal) over the contacts of fields (n,), and the
// state of the law before the step (n,).
struct ForceInput {
    const double* q = nullptr;
    const double* torque = nullptr;
    const LawState* state = nullptr;
    bool has_contacts = true;  // if false, the torque is zero
};

// A force that constrains the robot: its name, and the function that adds the force to `force` (n,) [rad/s^2].
struct Term {
    const char* name;
    void (*add)(const Law& law, const ForceInput& input, double* force);
    bool needs_state = false;  // whether the force depends on the state of the law; then the controller computes it, not the model
};

// Fill `forces` (terms, n) with all forces that constrain the robot.
void constraining_forces(const Law& law, const ForceInput& input, double* forces);

// Advance the state by one step of eq. 5.7 of dt [s].  `force` (n,) is the sum of all forces except spring and damping.  The states of
// motors that may not be moved do not change.
void advance(const Law& law, const double* q, double dt, const double* attractor, const double* force, LawState* state);

// Return the torque command [N m] of a motor for its velocity and acceleration, plus the feedforward torque.
double torque_of(const MotorGains& motor, const LawState& state);

// Check at time t [s] whether some motors have settled or timed out.  Between two checks they are `moving`, until the timeout.
Verdict check_settled(const Law& law, Interval motors, const LawState* state, double t, SettleTest& test);

// Return the squash of eq. 5.8 in one dimension.  It tends to `maximum`, and is half of it at v = knee = maximum / slope.
inline double squash(double v, double maximum, double knee) { return maximum * v / (knee + std::fabs(v)); }

// Return the limit force of one motor at q (eq. 5.12).
double limit_force(const MotorGains& motor, double q);

// Return the factor by which a motor's squash scales a client's force of norm `length` [rad/s^2].
double client_scale(const MotorGains& motor, double length);

}  // namespace mobee
