// SPDX-License-Identifier: Apache-2.0
// The motors of a simulated robot: lag, delay, backlash, friction, hard stops, and the noise of the encoders.
//
// It rounds as it is written.  A motor has two sides with play between them: the motor side follows what is commanded and drags the
// joint side along.
#pragma once

#include <cstdint>

#include "array.hpp"

namespace mobee {

// The first three as in `Modality`.
enum MotorMode : std::int64_t { position_mode, velocity_mode, torque_mode, hold_mode };

struct MotorNumbers {
    double low = 0.0, high = 0.0;  // hard stops
    double max_velocity = 0.0, max_acceleration = 0.0, max_torque = 0.0;
    double share = 0.0;     // of the way to a new velocity that a substep takes
    double play = 0.0;      // half of the backlash
    double friction = 0.0;  // the velocity that Coulomb friction costs
    std::int64_t delay = 0;  // substeps
};

struct MotorState {
    double q = 0.0, velocity = 0.0, effort = 0.0;  // of the joint side
    double motor_q = 0.0, motor_velocity = 0.0;    // of the motor side
    double dragged = 0.0;                          // where the motor side pulls the joint side
    double rest = 0.0;                             // where a hold stays
    double reference = 0.0;                        // what is commanded
    double load = 0.0;                             // a torque from outside
    double left = 0.0;                             // the torque that leaves the delay line
    std::int64_t mode = hold_mode;
    std::int64_t resting = 0;  // a hold has come to rest
};

struct Motors {
    View<const std::int64_t> living;  // those that live, ascending: the others rest
    View<const MotorNumbers> numbers;
    MotorState* state = nullptr;
    double* line = nullptr;  // (rows, n): what is on its way to the motors
    std::int64_t rows = 1;
    std::int64_t newest = 0;  // the row written last
    std::uint64_t seed = 0;   // of the encoders' noise
    double* drawn = nullptr;       // (living, 4): the noise of four ticks in units of its standard deviations, from
    std::int64_t drawn_from = -1;  // this one on, a multiple of four

    std::int64_t next(std::int64_t row) const { return row + 1 < rows ? row + 1 : 0; }
    double& on_its_way(std::int64_t row, std::int64_t motor) const { return line[row * numbers.size + motor]; }
};

// Change a motor's mode; what is on its way to it has another unit and becomes what it does now: in torque mode, carry its load.
void enter(const Motors& motors, std::int64_t motor, std::int64_t mode);

// Advance motors whose joint sides nothing blocks but the hard stops, by so many substeps of dt [s].
void move(Motors& motors, std::int64_t substeps, double dt);

// Fill `q` (n,) of the living motors with the joint sides plus noise of these standard deviations (n,); it is a pure function of seed,
// tick and motor.
void read_encoders(Motors& motors, std::int64_t tick, const double* noise, double* q);

}  // namespace mobee
