// SPDX-License-Identifier: Apache-2.0
// The motors of a simulated robot: lag, delay, backlash, friction, hard stops, and the noise of the encoders.
//
// The order of the floating-point operations is fixed.  A motor has two sides with backlash between them: the motor side follows the
// command and drags the joint side along.  Positions are in rad, for a motor that slides in m.
#pragma once

#include <cstdint>

#include "array.hpp"

namespace mobee {

// The first three are numbered as in `Modality`.
enum MotorMode : std::int64_t { position_mode, velocity_mode, torque_mode, hold_mode };

struct MotorConstants {
    double low = 0.0, high = 0.0;  // hard stops
    double max_velocity = 0.0, max_acceleration = 0.0, max_torque = 0.0;
    double response = 0.0;       // share of a velocity error that one substep removes (first-order lag)
    double half_backlash = 0.0;
    double friction = 0.0;       // Coulomb friction, as a decrease of velocity
    std::int64_t delay = 0;      // substeps
};

struct MotorState {
    double q = 0.0, velocity = 0.0, effort = 0.0;  // of the joint side; effort in N m
    double motor_q = 0.0, motor_velocity = 0.0;    // of the motor side
    double pulled_q = 0.0;        // position to which the motor side pulls the joint side
    double hold_q = 0.0;          // position that a hold keeps after braking
    double reference = 0.0;       // the command: position, velocity or torque, according to the mode
    double load = 0.0;            // external torque [N m]
    double applied_torque = 0.0;  // torque at the end of the delay line [N m]; 0 in other modes
    std::int64_t mode = hold_mode;
    std::int64_t holding = 0;     // whether a hold has braked to rest
};

struct Motors {
    View<const std::int64_t> living;       // indices of the simulated motors, ascending; the others never move
    View<const MotorConstants> constants;  // (n,)
    MotorState* state = nullptr;           // (n,)
    double* line = nullptr;                // (rows, n), the delay line: a ring of commands, one row per substep
    std::int64_t rows = 1;
    std::int64_t newest = 0;               // the row of the delay line written last
    std::uint64_t seed = 0;                // of the encoders' noise
    double* noise_samples = nullptr;       // (living, 4), standard normal samples for four ticks
    std::int64_t noise_tick = -1;          // the first of these ticks, a multiple of four; -1: no samples yet

    std::int64_t next(std::int64_t row) const { return row + 1 < rows ? row + 1 : 0; }
    double& delay_line(std::int64_t row, std::int64_t motor) const { return line[row * constants.size + motor]; }
};

// Change the mode of a motor.  Because the unit of commands changes, the delay line is filled with the present velocity, or in torque
// mode with the present load.
void set_mode(const Motors& motors, std::int64_t motor, std::int64_t mode);

// Advance the motors by `substeps` of dt [s]; only the hard stops can block the joint sides.
void move(Motors& motors, std::int64_t substeps, double dt);

// Fill the living motors' entries of `q` (n,) with joint positions plus normal noise of standard deviations `noise` (n,).  The noise
// depends on seed, tick and motor only.
void read_encoders(Motors& motors, std::int64_t tick, const double* noise, double* q);

}  // namespace mobee
