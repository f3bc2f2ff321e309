// SPDX-License-Identifier: Apache-2.0
#include "motors.hpp"

#include <algorithm>
#include <cmath>

#include "interface.hpp"
#include "lanes.hpp"
#include "law.hpp"
#include "normals.hpp"

namespace mobee {

namespace motors {

constexpr double servo_gain = 8.0;  // 1/s, position mode and a hold that has come to rest

// The nearest to x of low .. high; NaN stays.
double within(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

// The number nearer to 0 by that much, at most 0.
double shrunk(double x, double by) { return x > by ? x - by : x < -by ? x + by : x * 0.0; }

// The velocity towards a position.
double servo(const MotorNumbers& numbers, const MotorState& state, double position) {
    return within(servo_gain * (position - state.motor_q), -numbers.max_velocity, numbers.max_velocity);
}

// What enters the delay line: a torque in torque mode, else a velocity.
double wanted(const MotorNumbers& numbers, const MotorState& state) {
    if (state.mode == position_mode) return servo(numbers, state, state.reference);
    const double most = state.mode == torque_mode ? numbers.max_torque : numbers.max_velocity;
    return within(state.reference, -most, most);
}

// The velocity after a substep under a torque.
double turned(const MotorNumbers& numbers, const MotorState& state, double torque, double dt) {
    const double before = state.motor_velocity, most = numbers.max_acceleration;
    const double push = within((torque - state.load - motor_friction * before) / motor_inertia, -most, most);
    double slowed = before + push * dt;
    if (numbers.friction > 0.0) slowed = shrunk(slowed, motor_friction * numbers.friction / motor_inertia * dt);
    return within(slowed, -numbers.max_velocity, numbers.max_velocity);
}

// The velocity after a substep in which one was asked for: first order, less what Coulomb friction takes.
double responded(const MotorNumbers& numbers, const MotorState& state, double velocity) {
    const double after = state.motor_velocity + numbers.share * (velocity - state.motor_velocity);
    return numbers.friction > 0.0 ? shrunk(after, numbers.share * numbers.friction) : after;
}

// The velocity of a motor that brakes to rest and then stays where that was.
double held(const MotorNumbers& numbers, MotorState& state, double dt) {
    const double before = state.motor_velocity, change = numbers.max_acceleration * dt;
    if (!state.resting && std::fabs(before) <= change) {
        state.resting = 1;
        state.rest = state.motor_q;
    }
    if (state.resting) return servo(numbers, state, state.rest);
    return before - within(before, -change, change);
}

// Advance the motor side by a substep; `now`: the row of the delay line that is written.  Its effort is told by `note_effort`.
inline void turn(const Motors& motors, std::int64_t i, MotorState& state, std::int64_t now, double dt) {
    const MotorNumbers& numbers = motors.numbers[i];
    motors.on_its_way(now, i) = wanted(numbers, state);
    const std::int64_t then = now - numbers.delay;
    const double asked = motors.on_its_way(then >= 0 ? then : then + motors.rows, i);
    const bool torque = state.mode == torque_mode;
    state.left = torque ? asked : 0.0;
    state.motor_velocity = state.mode == hold_mode ? held(numbers, state, dt)
                           : torque                ? turned(numbers, state, asked, dt)
                                                   : responded(numbers, state, asked);
    state.motor_q += state.motor_velocity * dt;
    const double play = torque ? 0.0 : numbers.play;  // who commands torques takes the gear to be rigid
    state.dragged = within(state.q, state.motor_q - play, state.motor_q + play);
}

// What the motor exerted in a substep; `before`: its velocity until then.
inline void note_effort(MotorState& state, double before, double dt) {
    state.effort = motor_inertia * (state.motor_velocity - before) / dt + motor_friction * state.motor_velocity;
}

// Take the joint side at the end of a substep; the motor side follows into the play, so that nothing winds up.
inline void adopt(const MotorNumbers& numbers, MotorState& state, double q, double dt) {
    state.velocity = (q - state.q) / dt;
    state.q = q;
    if (state.mode == torque_mode) {
        state.motor_q = q;
        state.motor_velocity = state.velocity;
    } else {
        state.motor_q = within(state.motor_q, q - numbers.play, q + numbers.play);
    }
}

// References that never ask motors for more than their velocity and acceleration, and never for what cannot be braked.
struct Braking {
    std::int64_t count = 0;
    const double* lower = nullptr;
    const double* upper = nullptr;
    const double* fastest = nullptr;
    const double* change = nullptr;  // of the velocity in a tick
    double* velocity = nullptr;      // what is asked for now
    double dt = 0.0;

    // The largest velocity that whole ticks of full braking end within the distance.
    double within(std::int64_t i, double distance) const {
        return std::min(fastest[i], change[i] * (std::sqrt(0.25 + 2.0 * distance / (change[i] * dt)) - 0.5));
    }
    double down(std::int64_t i, double q) const { return within(i, std::max(q - lower[i], 0.0)); }
    double up(std::int64_t i, double q) const { return within(i, std::max(upper[i] - q, 0.0)); }

    // A tick nearer to the wanted velocity, and exactly there if it may be.
    void approach(std::int64_t i, double wanted) const {
        velocity[i] = std::min(std::max(wanted, velocity[i] - change[i]), velocity[i] + change[i]);
    }
};

}  // namespace motors

void enter(const Motors& motors, std::int64_t motor, std::int64_t mode) {
    MotorState& state = motors.state[motor];
    if (state.mode == mode) return;
    state.mode = mode;
    state.resting = 0;
    for (std::int64_t row = 0; row < motors.rows; ++row)
        motors.on_its_way(row, motor) = mode == torque_mode ? state.load : state.motor_velocity;
    if (mode == torque_mode) state.motor_q = state.q;  // from then on its gear is rigid
}

namespace motors {

void move_one(const Motors& motors, std::int64_t i, std::int64_t substeps, double dt) {
    MotorState state = motors.state[i];
    std::int64_t now = motors.newest;
    for (std::int64_t k = 0; k < substeps; ++k) {
        now = motors.next(now);
        const double before = state.motor_velocity;
        turn(motors, i, state, now, dt);
        if (k + 1 == substeps) note_effort(state, before, dt);
        state.dragged = within(state.dragged, motors.numbers[i].low, motors.numbers[i].high);
        adopt(motors.numbers[i], state, state.dragged, dt);
    }
    motors.state[i] = state;
}

inline Four within(Four x, Four low, Four high) { return x < low ? low : x > high ? high : x; }
inline Four shrunk(Four x, Four by) { return x > by ? x - by : x < -by ? x + by : x * 0.0; }

// Four motors side by side in position or velocity mode: in each lane what `move_one` does, in its order, so that the bits are the same.
struct FourMotors {
    const Motors& motors;
    std::int64_t index[4];  // where there are less than four the last one stands several times

    FourMotors(const Motors& of, std::int64_t first) : motors(of) {
        for (std::int64_t k = 0; k < 4; ++k) index[k] = of.living[std::min(first + k, of.living.size - 1)];
    }

    // Whether all of them are in these modes.
    bool fit() const {
        bool found = true;
        for (const std::int64_t i : index) found &= motors.state[i].mode <= velocity_mode;
        return found;
    }

    // Of each the four doubles from a member on, given as its place in the structure: a register for each member.
    template <class T>
    void fetch(const T* from, std::size_t place, Four& a, Four& b, Four& c, Four& d) const {
        const auto at = [&](int k) { return load<Four>(reinterpret_cast<const char*>(from + index[k]) + place); };
        a = at(0), b = at(1), c = at(2), d = at(3);
        transpose(a, b, c, d);
    }

    void put(std::size_t place, Four a, Four b, Four c, Four d) const {
        transpose(a, b, c, d);
        const Four values[4] = {a, b, c, d};
        for (int k = 0; k < 4; ++k) std::memcpy(reinterpret_cast<char*>(motors.state + index[k]) + place, &values[k], sizeof(Four));
    }

    // What leaves the delay line when `entering` enters it in the row `now`.
    Four delayed(std::int64_t now, Four entering, const std::int64_t* delay) const {
        Four leaving;
        for (int k = 0; k < 4; ++k) motors.on_its_way(now, index[k]) = entering[k];
        for (int k = 0; k < 4; ++k) {
            const std::int64_t then = now - delay[k];
            leaving[k] = motors.on_its_way(then >= 0 ? then : then + motors.rows, index[k]);
        }
        return leaving;
    }

    void move(std::int64_t substeps, double dt) const;
};

void FourMotors::move(std::int64_t substeps, double dt) const {
    using Numbers = MotorNumbers;
    using State = MotorState;
    Four low, high, fastest, unused, share, play, friction, q, velocity, effort, motor_q, turning, dragged, rest, reference;
    fetch(motors.numbers.data, offsetof(Numbers, low), low, high, fastest, unused);
    fetch(motors.numbers.data, offsetof(Numbers, max_torque), unused, share, play, friction);
    fetch(motors.state, offsetof(State, q), q, velocity, effort, motor_q);
    fetch(motors.state, offsetof(State, motor_velocity), turning, dragged, rest, reference);
    std::int64_t delay[4];
    FourMarks servoed;
    for (int k = 0; k < 4; ++k) {
        delay[k] = motors.numbers[index[k]].delay;
        servoed[k] = motors.state[index[k]].mode == position_mode ? -1 : 0;
        motors.state[index[k]].left = 0.0;
    }
    const FourMarks rubs = friction > 0.0;
    std::int64_t now = motors.newest;
    for (std::int64_t substep = 0; substep < substeps; ++substep) {
        now = motors.next(now);
        const Four wanted = servoed ? servo_gain * (reference - motor_q) : reference;
        const Four asked = delayed(now, within(wanted, -fastest, fastest), delay), before = turning;
        turning = before + share * (asked - before);
        turning = rubs ? shrunk(turning, share * friction) : turning;
        motor_q += turning * dt;
        if (substep + 1 == substeps) effort = motor_inertia * (turning - before) / dt + motor_friction * turning;
        dragged = within(within(q, motor_q - play, motor_q + play), low, high);
        velocity = (dragged - q) / dt;
        q = dragged;
        motor_q = within(motor_q, q - play, q + play);
    }
    put(offsetof(State, q), q, velocity, effort, motor_q);
    put(offsetof(State, motor_velocity), turning, dragged, rest, reference);
}

}  // namespace motors

void move(Motors& motors, std::int64_t substeps, double dt) {
    for (std::int64_t first = 0; first < motors.living.size; first += 4) {
        const motors::FourMotors four(motors, first);
        if (four.fit()) {
            four.move(substeps, dt);
        } else {
            for (std::int64_t k = first; k < std::min(first + 4, motors.living.size); ++k)
                motors::move_one(motors, motors.living[k], substeps, dt);
        }
    }
    motors.newest = (motors.newest + substeps) % motors.rows;
}

namespace motors {

void draw_noise(Motors& motors, std::int64_t first) {
    const Normals normals(motors.seed, first);
    double of_couple[2][4];
    std::int64_t drawn_last = -1;
    for (std::int64_t k = 0; k < motors.living.size; ++k) {
        const std::int64_t couple = motors.living[k] / 2;
        if (couple != drawn_last) normals.draw(couple, of_couple[0], of_couple[1]);
        drawn_last = couple;
        std::copy_n(of_couple[motors.living[k] % 2], 4, motors.drawn + 4 * k);
    }
    motors.drawn_from = first;
}

}  // namespace motors

void read_encoders(Motors& motors, std::int64_t tick, const double* noise, double* q) {
    const std::int64_t of_four = tick & 3;
    if (motors.drawn_from != tick - of_four) motors::draw_noise(motors, tick - of_four);
    for (std::int64_t k = 0; k < motors.living.size; ++k) {
        const std::int64_t i = motors.living[k];
        q[i] = motors.state[i].q + noise[i] * motors.drawn[4 * k + of_four];
    }
}

MOBEE_CALL void mobee_motors_enter(const Motors* motors, std::int64_t motor, std::int64_t mode) { enter(*motors, motor, mode); }

// Advance the motor sides by a substep of dt [s]; the joint sides are then told by `mobee_motors_adopt`.
MOBEE_CALL void mobee_motors_drive(Motors* motors, double dt) {
    motors->newest = motors->next(motors->newest);
    for (const std::int64_t i : motors->living) {
        const double before = motors->state[i].motor_velocity;
        motors::turn(*motors, i, motors->state[i], motors->newest, dt);
        motors::note_effort(motors->state[i], before, dt);
    }
}

MOBEE_CALL void mobee_motors_move(Motors* motors, std::int64_t substeps, double dt) { move(*motors, substeps, dt); }

MOBEE_CALL void mobee_motors_adopt(const Motors* motors, const double* q, double dt) {
    for (const std::int64_t i : motors->living) motors::adopt(motors->numbers[i], motors->state[i], q[i], dt);
}

MOBEE_CALL void mobee_motors_read(Motors* motors, std::int64_t tick, const double* noise, double* q) {
    read_encoders(*motors, tick, noise, q);
}

// Approach the wanted velocities; before a position limit no more than can still be braked.
MOBEE_CALL void mobee_braking_to_velocity(const motors::Braking* braking, const double* wanted, const double* q) {
    for (std::int64_t i = 0; i < braking->count; ++i)
        braking->approach(i, std::min(std::max(wanted[i], -braking->down(i, q[i])), braking->up(i, q[i])));
}

// Advance the positions `at` that are asked for, on the way to the wanted ones, to arrive there at rest.
MOBEE_CALL void mobee_braking_to_position(const motors::Braking* braking, const double* wanted, double* at) {
    for (std::int64_t i = 0; i < braking->count; ++i) {
        const double rest = std::min(std::max(wanted[i], braking->lower[i]), braking->upper[i]) - at[i];
        const double speed = std::min(braking->within(i, std::fabs(rest)), std::fabs(rest) / braking->dt);
        braking->approach(i, std::copysign(speed, rest));
        at[i] += braking->velocity[i] * braking->dt;
    }
}

// Whether some motor that moves so is a tick of braking too fast to stop before its position limit.
MOBEE_CALL bool mobee_braking_runs_out(const motors::Braking* braking, const double* q, const double* moving) {
    for (std::int64_t i = 0; i < braking->count; ++i) {
        const double change = braking->change[i];
        if (moving[i] > braking->up(i, q[i]) + change || moving[i] < -braking->down(i, q[i]) - change) return true;
    }
    return false;
}

}  // namespace mobee
