// SPDX-License-Identifier: Apache-2.0
// The control law: a spring to the attractor, damping, and the forces that constrain the robot (thesis eq. 5.7).
//
// It rounds as it is written: the same numbers as a program in Python that does these operations in this order.  Positions are in
// the motor's unit, rad or m; where a motor slides, forces count in rad and are brought to its unit (`unit`).
#pragma once

#include <cmath>
#include <cstdint>

#include "array.hpp"

namespace mobee {

// What a motor is told: a position, a velocity or a torque.
enum Modality : std::int64_t { position_modality, velocity_modality, torque_modality };

// What a torque-commanded motor is taken to be: inertia * dv/dt = torque - friction * v.
constexpr double motor_inertia = 0.5;   // kg m^2
constexpr double motor_friction = 5.0;  // N m s/rad

struct MotorGains {
    double low = 0.0, high = 0.0;  // limits
    double max_spring = 0.0, spring_knee = 0.0;  // most that the spring pulls, and how far it is from half of that: max_spring / stiffness
    double damping = 0.0;
    double limit_slope = 0.0;         // the limit force grows by this
    double below = 0.0, above = 0.0;  // from these distances to the limits on
    double client_slope = 0.0, max_client = 0.0, client_knee = 0.0;  // of a client's force, the same as of the spring
    double max_speed = 0.0, max_acceleration = 0.0, max_torque = 0.0;
    double leash = 0.0;  // how far the position reference may run ahead of the motor
    double unit = 1.0;   // what 1 rad of the gains is in the motor's unit, 1 where it turns
    double fine = 1.0;   // the same of the thresholds of the settle test
};

// A row of a clause asks for a.q + b > 0 and begins to push at `zone`.
struct ClauseRow {
    double offset = 0.0, zone = 0.0;
    Interval entries;
};

// A motor in such a row: its number in a, and in a / |a| with each motor in its unit.
struct ClauseEntry {
    std::int64_t motor = 0;
    double factor = 0.0, normal = 0.0;
};

// When a motion counts as died down: largest speed and acceleration; and times [s].
struct Settle {
    double speed = 0.0, acceleration = 0.0, first_look = 0.0, interval = 0.0, timeout = 0.0;
};

struct SettleTest {
    double begun = 0.0, next_look = 0.0;  // s
};

enum Verdict : std::int64_t { moving, settled, timed_out };

struct Law {
    View<const MotorGains> motors;
    View<const std::int64_t> active, felt;  // motors that are ever moved; motors on which forces are computed
    View<const Interval> parts;             // motors of each
    View<const Interval> clauses;           // rows of each
    View<const ClauseRow> rows;
    View<const ClauseEntry> entries;
    std::int64_t published = 0;  // the forces are those of the 2014 program
    std::int64_t touching = 0;   // contacts are felt
    std::int64_t direction = 0;  // a client's force is bounded by its norm in each part, not motor by motor
    std::int64_t modality = velocity_modality;
    double max_constraint = 0.0;                                        // of the clauses' force
    double contact_gain = 0.0, contact_slope = 0.0, max_contact = 0.0;  // of the contacts' force
    Settle settle;
};

// A motor's state under the law; `sent`: the velocity commanded last, `feedforward`: added to a torque command [N m].
struct LawState {
    double velocity = 0.0, acceleration = 0.0, sent = 0.0, reference = 0.0, feedforward = 0.0;
};

// What forces depend on, all of it (n,): the measured positions, the sum of J^T (depth * normal) over the contacts of fields, and the
// law's state before the step.
struct Moment {
    const double* q = nullptr;
    const double* torque = nullptr;
    const LawState* state = nullptr;
    bool touched = true;  // else the torque is zero
};

// A force on the motors: its name, and the function that adds it to `force` (n,), in rad/s^2.  Its numbers stand in the law.
struct Term {
    const char* name;
    void (*add)(const Law& law, const Moment& now, double* force);
    bool moving = false;  // it depends on the law's state: the model's process, which has none, leaves it to the controller
};

// Fill `forces` (terms, n), a row for each force that constrains the robot.
void constraining_forces(const Law& law, const Moment& now, double* forces);

// One step of eq. 5.7 by dt [s]; `force` (n,): the sum of its right-hand side.  Motors that are never moved keep their state.
void advance(const Law& law, const double* q, double dt, const double* attractor, const double* force, LawState* state);

// The torque [N m] that gives a motor its velocity and acceleration and carries what is fed forward.
double torque_of(const MotorGains& motor, const LawState& state);

// Judge the motion of some motors at time t [s]; between two looks it is always `moving`.
Verdict look(const Law& law, Interval motors, const LawState* state, double t, SettleTest& test);

// Eq. 5.8 of one dimension: `maximum` far out, half of it at the knee, which is maximum / slope.
inline double squash(double v, double maximum, double knee) { return maximum * v / (knee + std::fabs(v)); }

// Eq. 5.12: the force of one motor that keeps it inside its limits.
double limit_force(const MotorGains& motor, double q);

// What a motor's maximum and slope leave of a client's force of that norm [rad/s^2], as a factor.
double client_share(const MotorGains& motor, double length);

}  // namespace mobee
