// SPDX-License-Identifier: Apache-2.0
#include "law.hpp"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>

#include "interface.hpp"

namespace mobee {

namespace law {

constexpr double pi = 3.14159265358979323846;
constexpr double rounding = 1e-9;  // s, times are sums of ticks
constexpr double yield_force = 0.25;  // rad/s^2; an opposing force of this size ends the motion with a moving attractor

double norm(const double* v, std::int64_t count) {
    double squares = 0.0;
    for (std::int64_t i = 0; i < count; ++i) squares += v[i] * v[i];
    return std::sqrt(squares);
}

// Apply eq. 5.8 to the norm of v and keep its direction.
void squash_norm(double* v, std::int64_t count, double maximum, double slope) {
    const double length = norm(v, count);
    for (std::int64_t i = 0; i < count; ++i) v[i] = maximum * v[i] / (maximum / slope + length);
}

// Eqs. 5.12 and 5.13: zero outside the zones at the limits; inside a zone the force grows linearly and points away from the limit.
void add_limit_forces(const Law& law, const ForceInput& input, double* force) {
    for (const std::int64_t i : law.constrained) force[i] = limit_force(law.motors[i], input.q[i]);
}

// Return a.q + b of a row.
double row_value(const Law& law, const ClauseRow& row, const double* q) {
    double value = 0.0;
    for (std::int64_t k = row.entries.first; k < row.entries.end; ++k) value += law.entries[k].factor * q[law.entries[k].motor];
    return value + row.offset;
}

// Return the violation of a row: 0 where its zone begins, 1 on the boundary of the half-space, more than 1 beyond it (eq. 5.15).
double violation(const Law& law, const ClauseRow& row, const double* q) { return 1.0 - row_value(law, row, q) / row.zone; }

// Return whether a clause causes a force: q is outside no row's zone.  The published law also counts a row exactly at the start of
// its zone, where the force is 0.
bool is_active(const Law& law, Interval clause, const double* q) {
    for (std::int64_t r = clause.first; r < clause.end; ++r) {
        const double value = row_value(law, law.rows[r], q), zone = law.rows[r].zone;
        if (law.published ? value > zone : value >= zone) return false;
    }
    return true;
}

// Add a force of a given size along the unit normal of a row (eq. 5.15).
void push_along_normal(const Law& law, const ClauseRow& row, double size, double* force) {
    for (std::int64_t k = row.entries.first; k < row.entries.end; ++k) force[law.entries[k].motor] += size * law.entries[k].normal;
}

// Eqs. 5.14 to 5.17.  A clause is satisfied when one of its rows is.  The smallest violation in a clause sets the size of the force of
// all its rows, which keeps the force continuous where the minimum passes to another row.  In the published law the size for each row is
// its own violation.
void add_clause_forces(const Law& law, const ForceInput& input, double* force) {
    bool pushed = false;
    for (const Interval& clause : law.clauses) {
        if (!is_active(law, clause, input.q)) continue;
        pushed = true;
        double least = std::numeric_limits<double>::infinity();
        for (std::int64_t r = clause.first; r < clause.end; ++r) least = std::min(least, violation(law, law.rows[r], input.q));
        for (std::int64_t r = clause.first; r < clause.end; ++r) {
            const ClauseRow& row = law.rows[r];
            push_along_normal(law, row, law.published ? violation(law, row, input.q) : law.max_constraint * least, force);
        }
    }
    if (!pushed) return;
    for (const std::int64_t i : law.constrained) {
        if (law.published) force[i] = law.max_constraint * std::min(std::max(force[i], -1.0), 1.0);
        force[i] *= law.motors[i].unit;
    }
}

// Make a contact force quadratic in the penetration depth, in degrees, as the published law does.
void square(double* force, std::int64_t count) {
    const double length = norm(force, count);
    for (std::int64_t i = 0; i < count; ++i) force[i] = length * force[i] * (pi / 180.0);
}

// Eq. 5.11: L(gain * sum of J^T depth), with the norm of each part's force bounded (eq. 5.8).
void add_collision_forces(const Law& law, const ForceInput& input, double* force) {
    if (!law.contact_forces || !input.has_contacts) return;
    for (const Interval& part : law.parts) {
        bool touched = false;
        for (std::int64_t i = part.first; i < part.end; ++i) {
            force[i] = law.contact_gain * input.torque[i] * law.motors[i].unit;
            touched = touched || force[i] != 0.0;
        }
        if (!touched) continue;
        const std::int64_t count = part.end - part.first;
        if (law.published) square(force + part.first, count);
        squash_norm(force + part.first, count, law.max_contact, law.contact_slope);
        for (std::int64_t i = part.first; i < part.end; ++i) force[i] *= law.motors[i].unit;
    }
}

// All forces that constrain the robot, in the order in which they are added.
constexpr Term terms[] = {
    {"limits", add_limit_forces},
    {"constraints", add_clause_forces},
    {"collision", add_collision_forces},
};
constexpr std::int64_t term_count = std::size(terms);

// Eq. 5.7 solved for the acceleration: squashed spring plus forces minus damping, which is relative to the attractor's velocity.
double acceleration(double q, double velocity, double attractor, double force, const MotorGains& motor) {
    return squash(attractor - q, motor.max_spring, motor.spring_knee) + force - motor.damping * velocity;
}

// Return the velocity of a moving attractor that a motor follows: less if a force opposes it, and none from `yield_force` on.
double followed_velocity(double goal_velocity, double force, double unit) {
    if (goal_velocity * force >= 0.0) return goal_velocity;
    return goal_velocity * std::max(0.0, 1.0 - std::fabs(force) / (yield_force * unit));
}

// Return the velocity command: at most `fastest`, and at most `change` away from the last command `sent`.
double limited_velocity(double velocity, double sent, double fastest, double change) {
    const double wanted = std::min(std::max(velocity, -fastest), fastest);
    return sent + std::min(std::max(wanted - sent, -change), change);
}

// Return the position reference after a step.  It does not advance while it leads a blocked motor by more than `max_lead`.
double advanced_reference(double reference, double q, double velocity, double dt, const MotorGains& motor) {
    const double lead = reference - q;
    const bool is_blocked = std::fabs(lead) > motor.max_lead && lead * velocity > 0.0;
    return std::min(std::max(is_blocked ? reference : reference + velocity * dt, motor.low), motor.high);
}

bool is_slow(const Settle& settle, double velocity, double change, double unit) {
    return std::fabs(velocity) <= settle.speed * unit && std::fabs(change) <= settle.acceleration * unit;
}

// Return the verdict on a motion at time t [s].  `slow(i)` returns whether motor i is slow; it is called only when a check is due.
template <class Slow>
Verdict check_motion(const Settle& settle, SettleTest& test, double t, Interval motors, Slow slow) {
    if (t >= test.next_check - rounding) {
        const double missed = std::floor((t - test.next_check + rounding) / settle.interval);
        test.next_check += (missed + 1.0) * settle.interval;
        std::int64_t i = motors.first;
        while (i < motors.end && slow(i)) ++i;
        if (i == motors.end) return settled;
    }
    return t - test.start >= settle.timeout - rounding ? timed_out : moving;
}

}  // namespace law

double limit_force(const MotorGains& motor, double q) {
    return motor.limit_slope * (std::max(motor.low + motor.low_zone - q, 0.0) - std::max(q - motor.high + motor.high_zone, 0.0));
}

void constraining_forces(const Law& law, const ForceInput& input, double* forces) {
    std::fill_n(forces, law::term_count * law.motors.size, 0.0);
    for (const Term& term : law::terms) {
        term.add(law, input, forces);
        forces += law.motors.size;
    }
}

double client_scale(const MotorGains& motor, double length) {
    const double maximum = motor.max_client / motor.unit;
    return maximum / (maximum / motor.client_slope + length);
}

void advance(const Law& law, const double* q, double dt, const double* attractor, const double* force, LawState* state) {
    for (const std::int64_t i : law.active) {
        const MotorGains& motor = law.motors[i];
        LawState& own = state[i];
        double ahead = 0.0;
        if (own.goal_time > 0.0) {
            ahead = law::followed_velocity(own.goal_velocity, force[i], motor.unit);
            own.goal_time -= dt;
        }
        const double a = law::acceleration(q[i], own.velocity - ahead, attractor[i], force[i], motor);
        const double v = law::limited_velocity(own.velocity + a * dt, own.commanded, motor.max_speed, motor.max_acceleration * dt);
        own.acceleration = (v - own.commanded) / dt;  // of the command: after a hold `velocity` is 0, and `commanded` may not be
        own.velocity = own.commanded = v;
        own.reference = law::advanced_reference(own.reference, q[i], v, dt, motor);
    }
}

double torque_of(const MotorGains& motor, const LawState& state) {
    const double wanted = motor_inertia * state.acceleration + motor_friction * state.velocity + state.feedforward;
    return std::min(std::max(wanted, -motor.max_torque), motor.max_torque);
}

Verdict check_settled(const Law& law, Interval motors, const LawState* state, double t, SettleTest& test) {
    const auto slow = [&](std::int64_t i) { return law::is_slow(law.settle, state[i].velocity, state[i].acceleration, law.motors[i].settle_unit); };
    return law::check_motion(law.settle, test, t, motors, slow);
}

// Bound a client's force f (eqs. 5.9 and 5.10) and add it to `total`, both (n,).
MOBEE_CALL void mobee_law_client(const Law* of, const double* f, double* total) {
    const Law& law = *of;
    if (!law.keeps_direction) {
        for (const std::int64_t i : law.constrained) total[i] += squash(f[i], law.motors[i].max_client, law.motors[i].client_knee);
        return;
    }
    for (const Interval& part : law.parts) {
        double squares = 0.0;
        for (std::int64_t i = part.first; i < part.end; ++i) {
            const double angle = f[i] / law.motors[i].unit;
            squares += angle * angle;
        }
        const double length = std::sqrt(squares);
        std::int64_t narrowest = part.first;
        for (std::int64_t i = part.first; i < part.end; ++i)
            if (client_scale(law.motors[i], length) < client_scale(law.motors[narrowest], length)) narrowest = i;
        const MotorGains& motor = law.motors[narrowest];
        const double maximum = motor.max_client / motor.unit, slope = motor.client_slope;
        for (std::int64_t i = part.first; i < part.end; ++i) total[i] += maximum * f[i] / (maximum / slope + length);
    }
}

MOBEE_CALL void mobee_law_forces(const Law* law, const double* q, const double* torque, const LawState* state, double* forces) {
    constraining_forces(*law, {q, torque, state}, forces);
}

// Advance the law by a step and fill `commands` (3, n): position, velocity and torque.
MOBEE_CALL void mobee_law_step(const Law* law, const double* q, double dt, const double* attractor, const double* force,
                               LawState* state, double* commands) {
    advance(*law, q, dt, attractor, force, state);
    const std::int64_t n = law->motors.size;
    for (std::int64_t i = 0; i < n; ++i) {
        commands[i] = state[i].reference;
        commands[n + i] = state[i].velocity;
        commands[2 * n + i] = torque_of(law->motors[i], state[i]);
    }
}

// Check commanded velocities and accelerations, (2, count), each divided by its motor's `settle_unit`.
MOBEE_CALL std::int64_t mobee_settle_check(const Settle* settle, SettleTest* test, double t, const double* motion, std::int64_t count) {
    const auto slow = [=](std::int64_t i) { return law::is_slow(*settle, motion[i], motion[count + i], 1.0); };
    return law::check_motion(*settle, *test, t, {0, count}, slow);
}

// The name of a term by its index; null behind the last term.  The next function: whether the term depends on the law's state.
MOBEE_CALL const char* mobee_law_term(std::int64_t index) {
    return index < law::term_count ? law::terms[index].name : nullptr;
}

MOBEE_CALL std::int64_t mobee_law_needs_state(std::int64_t index) { return law::terms[index].needs_state; }

}  // namespace mobee
