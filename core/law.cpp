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

double norm(const double* v, std::int64_t count) {
    double squares = 0.0;
    for (std::int64_t i = 0; i < count; ++i) squares += v[i] * v[i];
    return std::sqrt(squares);
}

// Eq. 5.8 of the norm, the direction kept.
void squash_norm(double* v, std::int64_t count, double maximum, double slope) {
    const double length = norm(v, count);
    for (std::int64_t i = 0; i < count; ++i) v[i] = maximum * v[i] / (maximum / slope + length);
}

// Eqs. 5.12 and 5.13: zero inside the zones, then a linear ramp inward.
void add_limit_forces(const Law& law, const Moment& now, double* force) {
    for (const std::int64_t i : law.felt) force[i] = limit_force(law.motors[i], now.q[i]);
}

// What a row is worth: a.q + b.
double worth(const Law& law, const ClauseRow& row, const double* q) {
    double value = 0.0;
    for (std::int64_t k = row.entries.first; k < row.entries.end; ++k) value += law.entries[k].factor * q[law.entries[k].motor];
    return value + row.offset;
}

// How much a row lacks of being satisfied with margin: 0 where the zone begins, 1 on the boundary, on beyond it (eq. 5.15).
double lack(const Law& law, const ClauseRow& row, const double* q) { return 1.0 - worth(law, row, q) / row.zone; }

// Whether a clause pushes: no row is satisfied with margin.  The published law also counts where a zone begins, by 0.
bool pushes(const Law& law, Interval clause, const double* q) {
    for (std::int64_t r = clause.first; r < clause.end; ++r) {
        const double value = worth(law, law.rows[r], q), zone = law.rows[r].zone;
        if (law.published ? value > zone : value >= zone) return false;
    }
    return true;
}

// A push along the unit normal of a row (eq. 5.15).
void push(const Law& law, const ClauseRow& row, double size, double* force) {
    for (std::int64_t k = row.entries.first; k < row.entries.end; ++k) force[law.entries[k].motor] += size * law.entries[k].normal;
}

// Eqs. 5.14 to 5.17.  A clause is satisfied when one of its rows is.  The row nearest to that sets the push of all rows, which keeps
// the force continuous where another row becomes the nearest; the published law pushes each row by what it lacks itself.
void add_clause_forces(const Law& law, const Moment& now, double* force) {
    bool pushed = false;
    for (const Interval& clause : law.clauses) {
        if (!pushes(law, clause, now.q)) continue;
        pushed = true;
        double least = std::numeric_limits<double>::infinity();
        for (std::int64_t r = clause.first; r < clause.end; ++r) least = std::min(least, lack(law, law.rows[r], now.q));
        for (std::int64_t r = clause.first; r < clause.end; ++r) {
            const ClauseRow& row = law.rows[r];
            push(law, row, law.published ? lack(law, row, now.q) : law.max_constraint * least, force);
        }
    }
    if (!pushed) return;
    for (const std::int64_t i : law.felt) {
        if (law.published) force[i] = law.max_constraint * std::min(std::max(force[i], -1.0), 1.0);
        force[i] *= law.motors[i].unit;
    }
}

// The published law is quadratic in the penetration, in degrees.
void square(double* force, std::int64_t count) {
    const double length = norm(force, count);
    for (std::int64_t i = 0; i < count; ++i) force[i] = length * force[i] * (pi / 180.0);
}

// Eq. 5.11: L(gain * sum of J^T depth), its norm bounded part by part (eq. 5.8).
void add_collision_forces(const Law& law, const Moment& now, double* force) {
    if (!law.touching || !now.touched) return;
    for (const Interval& part : law.parts) {
        bool touched = false;
        for (std::int64_t i = part.first; i < part.end; ++i) {
            force[i] = law.contact_gain * now.torque[i] * law.motors[i].unit;
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

// Eq. 5.7 solved for the acceleration: squashed spring plus forces minus damping.
double acceleration(double q, double velocity, double attractor, double force, const MotorGains& motor) {
    return squash(attractor - q, motor.max_spring, motor.spring_knee) + force - motor.damping * velocity;
}

// The velocity that a motor is told: within its speed, and within `change` of what was sent last.
double bounded(double velocity, double sent, double fastest, double change) {
    const double wanted = std::min(std::max(velocity, -fastest), fastest);
    return sent + std::min(std::max(wanted - sent, -change), change);
}

// The position reference one step on: it waits while it is farther than the leash ahead of a motor that something blocks.
double led(double reference, double q, double velocity, double dt, const MotorGains& motor) {
    const double lead = reference - q;
    const bool waits = std::fabs(lead) > motor.leash && lead * velocity > 0.0;
    return std::min(std::max(waits ? reference : reference + velocity * dt, motor.low), motor.high);
}

bool is_slow(const Settle& settle, double velocity, double change, double unit) {
    return std::fabs(velocity) <= settle.speed * unit && std::fabs(change) <= settle.acceleration * unit;
}

// Judge a motion at time t [s]; `slow` says of each motor whether it is, and is asked when it is time to look.
template <class Slow>
Verdict judge(const Settle& settle, SettleTest& test, double t, Interval motors, Slow slow) {
    if (t >= test.next_look - rounding) {
        const double missed = std::floor((t - test.next_look + rounding) / settle.interval);
        test.next_look += (missed + 1.0) * settle.interval;
        std::int64_t i = motors.first;
        while (i < motors.end && slow(i)) ++i;
        if (i == motors.end) return settled;
    }
    return t - test.begun >= settle.timeout - rounding ? timed_out : moving;
}

}  // namespace law

double limit_force(const MotorGains& motor, double q) {
    return motor.limit_slope * (std::max(motor.low + motor.below - q, 0.0) - std::max(q - motor.high + motor.above, 0.0));
}

void constraining_forces(const Law& law, const Moment& now, double* forces) {
    std::fill_n(forces, law::term_count * law.motors.size, 0.0);
    for (const Term& term : law::terms) {
        term.add(law, now, forces);
        forces += law.motors.size;
    }
}

double client_share(const MotorGains& motor, double length) {
    const double maximum = motor.max_client / motor.unit;
    return maximum / (maximum / motor.client_slope + length);
}

void advance(const Law& law, const double* q, double dt, const double* attractor, const double* force, LawState* state) {
    for (const std::int64_t i : law.active) {
        const MotorGains& motor = law.motors[i];
        LawState& own = state[i];
        const double a = law::acceleration(q[i], own.velocity, attractor[i], force[i], motor);
        const double v = law::bounded(own.velocity + a * dt, own.sent, motor.max_speed, motor.max_acceleration * dt);
        own.acceleration = (v - own.sent) / dt;  // of what is sent: after a hold the own velocity is 0 and that is not
        own.velocity = own.sent = v;
        own.reference = law::led(own.reference, q[i], v, dt, motor);
    }
}

double torque_of(const MotorGains& motor, const LawState& state) {
    const double wanted = motor_inertia * state.acceleration + motor_friction * state.velocity + state.feedforward;
    return std::min(std::max(wanted, -motor.max_torque), motor.max_torque);
}

Verdict look(const Law& law, Interval motors, const LawState* state, double t, SettleTest& test) {
    const auto slow = [&](std::int64_t i) { return law::is_slow(law.settle, state[i].velocity, state[i].acceleration, law.motors[i].fine); };
    return law::judge(law.settle, test, t, motors, slow);
}

// Add a client's force f, bounded (eqs. 5.9 and 5.10), to `total`, both (n,).
MOBEE_CALL void mobee_law_client(const Law* of, const double* f, double* total) {
    const Law& law = *of;
    if (!law.direction) {
        for (const std::int64_t i : law.felt) total[i] += squash(f[i], law.motors[i].max_client, law.motors[i].client_knee);
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
            if (client_share(law.motors[i], length) < client_share(law.motors[narrowest], length)) narrowest = i;
        const MotorGains& motor = law.motors[narrowest];
        const double maximum = motor.max_client / motor.unit, slope = motor.client_slope;
        for (std::int64_t i = part.first; i < part.end; ++i) total[i] += maximum * f[i] / (maximum / slope + length);
    }
}

MOBEE_CALL void mobee_law_forces(const Law* law, const double* q, const double* torque, const LawState* state, double* forces) {
    constraining_forces(*law, {q, torque, state}, forces);
}

// `commands` (3, n): position, velocity, torque.
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

// Judge commanded velocities and accelerations, (2, count), in fine units.
MOBEE_CALL std::int64_t mobee_law_look(const Settle* settle, SettleTest* test, double t, const double* motion, std::int64_t count) {
    const auto slow = [=](std::int64_t i) { return law::is_slow(*settle, motion[i], motion[count + i], 1.0); };
    return law::judge(*settle, *test, t, {0, count}, slow);
}

// The term of that number: its name, none behind the last, and whether it depends on the state.
MOBEE_CALL const char* mobee_law_term(std::int64_t index) {
    return index < law::term_count ? law::terms[index].name : nullptr;
}

MOBEE_CALL std::int64_t mobee_law_moving(std::int64_t index) { return law::terms[index].moving; }

}  // namespace mobee
