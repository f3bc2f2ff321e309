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

// Clip x to low .. high; NaN stays NaN.
double clamped(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

// Move a number towards 0 by a given amount; stop at 0.
double reduced(double x, double by) { return x > by ? x - by : x < -by ? x + by : x * 0.0; }

// Return the velocity command of the position servo.
double servo(const MotorConstants& constants, const MotorState& state, double position) {
    return clamped(servo_gain * (position - state.motor_q), -constants.max_velocity, constants.max_velocity);
}

// Return the entry of the delay line: a torque in torque mode, else a velocity.
double delay_line_input(const MotorConstants& constants, const MotorState& state) {
    if (state.mode == position_mode) return servo(constants, state, state.reference);
    const double limit = state.mode == torque_mode ? constants.max_torque : constants.max_velocity;
    return clamped(state.reference, -limit, limit);
}

// Return the velocity after a substep under a torque.
double torque_response(const MotorConstants& constants, const MotorState& state, double torque, double dt) {
    const double before = state.motor_velocity, limit = constants.max_acceleration;
    const double acceleration = clamped((torque - state.load - motor_friction * before) / motor_inertia, -limit, limit);
    double velocity = before + acceleration * dt;
    if (constants.friction > 0.0) velocity = reduced(velocity, motor_friction * constants.friction / motor_inertia * dt);
    return clamped(velocity, -constants.max_velocity, constants.max_velocity);
}

// Return the velocity after a substep under a velocity command: a first-order lag, then Coulomb friction.
double velocity_response(const MotorConstants& constants, const MotorState& state, double velocity) {
    const double after = state.motor_velocity + constants.response * (velocity - state.motor_velocity);
    return constants.friction > 0.0 ? reduced(after, constants.response * constants.friction) : after;
}

// Return the velocity of a motor in a hold: it brakes to rest and then keeps its position.
double hold_response(const MotorConstants& constants, MotorState& state, double dt) {
    const double before = state.motor_velocity, change = constants.max_acceleration * dt;
    if (!state.holding && std::fabs(before) <= change) {
        state.holding = 1;
        state.hold_q = state.motor_q;
    }
    if (state.holding) return servo(constants, state, state.hold_q);
    return before - clamped(before, -change, change);
}

// Advance the motor side by a substep.  `now` is the row of the delay line to write.  `update_effort` computes the effort afterwards.
inline void advance_motor(const Motors& motors, std::int64_t i, MotorState& state, std::int64_t now, double dt) {
    const MotorConstants& constants = motors.constants[i];
    motors.delay_line(now, i) = delay_line_input(constants, state);
    const std::int64_t then = now - constants.delay;
    const double commanded = motors.delay_line(then >= 0 ? then : then + motors.rows, i);
    const bool in_torque_mode = state.mode == torque_mode;
    state.applied_torque = in_torque_mode ? commanded : 0.0;
    state.motor_velocity = state.mode == hold_mode ? hold_response(constants, state, dt)
                           : in_torque_mode        ? torque_response(constants, state, commanded, dt)
                                                   : velocity_response(constants, state, commanded);
    state.motor_q += state.motor_velocity * dt;
    const double play = in_torque_mode ? 0.0 : constants.half_backlash;  // the model of torque mode has a rigid gear
    state.pulled_q = clamped(state.q, state.motor_q - play, state.motor_q + play);
}

// Compute the effort of the motor in a substep.  `before` is its velocity before the substep.
inline void update_effort(MotorState& state, double before, double dt) {
    state.effort = motor_inertia * (state.motor_velocity - before) / dt + motor_friction * state.motor_velocity;
}

// Set the joint side at the end of a substep.  The motor side is moved to within the backlash, so that no error accumulates.
inline void set_joint(const MotorConstants& constants, MotorState& state, double q, double dt) {
    state.velocity = (q - state.q) / dt;
    state.q = q;
    if (state.mode == torque_mode) {
        state.motor_q = q;
        state.motor_velocity = state.velocity;
    } else {
        state.motor_q = clamped(state.motor_q, q - constants.half_backlash, q + constants.half_backlash);
    }
}

// References within the velocity and acceleration limits of the motors, from which each motor can stop before its position limit.
struct Braking {
    std::int64_t count = 0;
    const double* lower = nullptr;
    const double* upper = nullptr;
    const double* fastest = nullptr;
    const double* change = nullptr;  // largest change of velocity in a tick
    double* velocity = nullptr;      // the present reference
    double dt = 0.0;

    // Return the largest velocity from which full braking in whole ticks ends within the distance.
    double within(std::int64_t i, double distance) const {
        return std::min(fastest[i], change[i] * (std::sqrt(0.25 + 2.0 * distance / (change[i] * dt)) - 0.5));
    }
    double down(std::int64_t i, double q) const { return within(i, std::max(q - lower[i], 0.0)); }
    double up(std::int64_t i, double q) const { return within(i, std::max(upper[i] - q, 0.0)); }

    // Change the velocity towards the wanted one by a tick; it becomes exactly the wanted one if that is within reach.
    void approach(std::int64_t i, double wanted) const {
        velocity[i] = std::min(std::max(wanted, velocity[i] - change[i]), velocity[i] + change[i]);
    }
};

}  // namespace motors

void set_mode(const Motors& motors, std::int64_t motor, std::int64_t mode) {
    MotorState& state = motors.state[motor];
    if (state.mode == mode) return;
    state.mode = mode;
    state.holding = 0;
    for (std::int64_t row = 0; row < motors.rows; ++row)
        motors.delay_line(row, motor) = mode == torque_mode ? state.load : state.motor_velocity;
    if (mode == torque_mode) state.motor_q = state.q;  // torque mode has a rigid gear
}

namespace motors {

void move_one(const Motors& motors, std::int64_t i, std::int64_t substeps, double dt) {
    MotorState state = motors.state[i];
    std::int64_t now = motors.newest;
    for (std::int64_t k = 0; k < substeps; ++k) {
        now = motors.next(now);
        const double before = state.motor_velocity;
        advance_motor(motors, i, state, now, dt);
        if (k + 1 == substeps) update_effort(state, before, dt);
        state.pulled_q = clamped(state.pulled_q, motors.constants[i].low, motors.constants[i].high);
        set_joint(motors.constants[i], state, state.pulled_q, dt);
    }
    motors.state[i] = state;
}

inline Four clamped(Four x, Four low, Four high) { return x < low ? low : x > high ? high : x; }
inline Four reduced(Four x, Four by) { return x > by ? x - by : x < -by ? x + by : x * 0.0; }

// Four motors in position or velocity mode, one in each SIMD lane.  Each lane does the operations of `move_one` in the same order, so that
// the results have equal bits.
struct FourMotors {
    const Motors& motors;
    std::int64_t index[4];  // of the motors; the last index is repeated if there are fewer than four

    FourMotors(const Motors& of, std::int64_t first) : motors(of) {
        for (std::int64_t k = 0; k < 4; ++k) index[k] = of.living[std::min(first + k, of.living.size - 1)];
    }

    // Return whether all four motors are in position or velocity mode.
    bool have_rate_modes() const {
        bool all = true;
        for (const std::int64_t i : index) all &= motors.state[i].mode <= velocity_mode;
        return all;
    }

    // Load four consecutive members of each motor's structure, from byte offset `place` on, into one register for each member.
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

    // Write `entering` into row `now` of the delay line and return the command that leaves the line.
    Four pass_delay_line(std::int64_t now, Four entering, const std::int64_t* delay) const {
        Four leaving;
        for (int k = 0; k < 4; ++k) motors.delay_line(now, index[k]) = entering[k];
        for (int k = 0; k < 4; ++k) {
            const std::int64_t then = now - delay[k];
            leaving[k] = motors.delay_line(then >= 0 ? then : then + motors.rows, index[k]);
        }
        return leaving;
    }

    void move(std::int64_t substeps, double dt) const;
};

void FourMotors::move(std::int64_t substeps, double dt) const {
    using Constants = MotorConstants;
    using State = MotorState;
    Four low, high, fastest, unused, response, half_backlash, friction, q, velocity, effort, motor_q, motor_velocity, pulled_q, hold_q, reference;
    fetch(motors.constants.data, offsetof(Constants, low), low, high, fastest, unused);
    fetch(motors.constants.data, offsetof(Constants, max_torque), unused, response, half_backlash, friction);
    fetch(motors.state, offsetof(State, q), q, velocity, effort, motor_q);
    fetch(motors.state, offsetof(State, motor_velocity), motor_velocity, pulled_q, hold_q, reference);
    std::int64_t delay[4];
    FourMarks is_servo;
    for (int k = 0; k < 4; ++k) {
        delay[k] = motors.constants[index[k]].delay;
        is_servo[k] = motors.state[index[k]].mode == position_mode ? -1 : 0;
        motors.state[index[k]].applied_torque = 0.0;
    }
    const FourMarks has_friction = friction > 0.0;
    std::int64_t now = motors.newest;
    for (std::int64_t substep = 0; substep < substeps; ++substep) {
        now = motors.next(now);
        const Four wanted = is_servo ? servo_gain * (reference - motor_q) : reference;
        const Four commanded = pass_delay_line(now, clamped(wanted, -fastest, fastest), delay), before = motor_velocity;
        motor_velocity = before + response * (commanded - before);
        motor_velocity = has_friction ? reduced(motor_velocity, response * friction) : motor_velocity;
        motor_q += motor_velocity * dt;
        if (substep + 1 == substeps) effort = motor_inertia * (motor_velocity - before) / dt + motor_friction * motor_velocity;
        pulled_q = clamped(clamped(q, motor_q - half_backlash, motor_q + half_backlash), low, high);
        velocity = (pulled_q - q) / dt;
        q = pulled_q;
        motor_q = clamped(motor_q, q - half_backlash, q + half_backlash);
    }
    put(offsetof(State, q), q, velocity, effort, motor_q);
    put(offsetof(State, motor_velocity), motor_velocity, pulled_q, hold_q, reference);
}

}  // namespace motors

void move(Motors& motors, std::int64_t substeps, double dt) {
    for (std::int64_t first = 0; first < motors.living.size; first += 4) {
        const motors::FourMotors four(motors, first);
        if (four.have_rate_modes()) {
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
        std::copy_n(of_couple[motors.living[k] % 2], 4, motors.noise_samples + 4 * k);
    }
    motors.noise_tick = first;
}

}  // namespace motors

void read_encoders(Motors& motors, std::int64_t tick, const double* noise, double* q) {
    const std::int64_t of_four = tick & 3;
    if (motors.noise_tick != tick - of_four) motors::draw_noise(motors, tick - of_four);
    for (std::int64_t k = 0; k < motors.living.size; ++k) {
        const std::int64_t i = motors.living[k];
        q[i] = motors.state[i].q + noise[i] * motors.noise_samples[4 * k + of_four];
    }
}

MOBEE_CALL void mobee_motors_enter(const Motors* motors, std::int64_t motor, std::int64_t mode) { set_mode(*motors, motor, mode); }

// Advance the motor sides by a substep of dt [s]; `mobee_motors_adopt` then sets the joint sides.
MOBEE_CALL void mobee_motors_drive(Motors* motors, double dt) {
    motors->newest = motors->next(motors->newest);
    for (const std::int64_t i : motors->living) {
        const double before = motors->state[i].motor_velocity;
        motors::advance_motor(*motors, i, motors->state[i], motors->newest, dt);
        motors::update_effort(motors->state[i], before, dt);
    }
}

MOBEE_CALL void mobee_motors_move(Motors* motors, std::int64_t substeps, double dt) { move(*motors, substeps, dt); }

MOBEE_CALL void mobee_motors_adopt(const Motors* motors, const double* q, double dt) {
    for (const std::int64_t i : motors->living) motors::set_joint(motors->constants[i], motors->state[i], q[i], dt);
}

MOBEE_CALL void mobee_motors_read(Motors* motors, std::int64_t tick, const double* noise, double* q) {
    read_encoders(*motors, tick, noise, q);
}

// Change the velocities towards the wanted ones; near a position limit, only so far that the motor can still stop before it.
MOBEE_CALL void mobee_braking_to_velocity(const motors::Braking* braking, const double* wanted, const double* q) {
    for (std::int64_t i = 0; i < braking->count; ++i)
        braking->approach(i, std::min(std::max(wanted[i], -braking->down(i, q[i])), braking->up(i, q[i])));
}

// Advance the position references `at` towards the wanted positions, so that they arrive at rest.
MOBEE_CALL void mobee_braking_to_position(const motors::Braking* braking, const double* wanted, double* at) {
    for (std::int64_t i = 0; i < braking->count; ++i) {
        const double rest = std::min(std::max(wanted[i], braking->lower[i]), braking->upper[i]) - at[i];
        const double speed = std::min(braking->within(i, std::fabs(rest)), std::fabs(rest) / braking->dt);
        braking->approach(i, std::copysign(speed, rest));
        at[i] += braking->velocity[i] * braking->dt;
    }
}

// Return whether some motor with these velocities cannot stop before its position limit if it brakes one tick later.
MOBEE_CALL bool mobee_braking_runs_out(const motors::Braking* braking, const double* q, const double* moving) {
    for (std::int64_t i = 0; i < braking->count; ++i) {
        const double change = braking->change[i];
        if (moving[i] > braking->up(i, q[i]) + change || moving[i] < -braking->down(i, q[i]) - change) return true;
    }
    return false;
}

}  // namespace mobee
