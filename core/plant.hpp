// The offline plant: encoders, model, law and motors of one robot, tick after tick.
#pragma once

#include <cstdint>

#include "law.hpp"
#include "motors.hpp"
#include "neighbours.hpp"
#include "reach.hpp"
#include "view.hpp"

namespace mobee {

// A part and its action: whether it is under way, how the last one ended, and its settle test.
struct PartAction {
    Interval motors;
    std::int64_t under_way = 0;
    std::int64_t verdict = moving;
    SettleTest test;
};

enum RunEnd : std::int64_t { all_ticks_done, action_ended, state_lost };

// What stands in a row of the record, behind encoders, joint sides and commanded velocities, each (n,): the deepest contacts [m].
constexpr std::int64_t record_depths = 2;

// All of it belongs to whoever made the plant.
struct Plant {
    Neighbours* near = nullptr;  // of the robot in the world; none: nothing is felt
    const Law* law = nullptr;
    LawState* law_state = nullptr;
    double* attractor = nullptr;     // (n,)
    const double* client = nullptr;  // (n,), f_config and f_work, bounded
    double* forces = nullptr;        // (rows, n): those of the law's terms, behind them any others, given for one tick
    std::int64_t rows = 0;
    View<Reach* const> reaches;
    Motors* motors = nullptr;
    double* commands = nullptr;  // (command_age, n): those on their way to the motors
    std::int64_t command_age = 1;
    std::int64_t substeps = 1;
    double dt = 0.0;  // s, a tick
    const double* noise = nullptr;  // (n,), standard deviations of the encoders; none: they have no noise
    View<PartAction> parts;
    double* q = nullptr;       // (n,), the encoders of the last tick
    double* torque = nullptr;  // (n,), the sum of J^T (depth * normal) there
    double* total = nullptr;   // (n,), the right-hand side of eq. 5.7
    double* record = nullptr;  // (most, 3 n + record_depths), a row a tick; none: nothing is recorded
    std::int64_t ticks = 0;    // that there have been
    std::int64_t most = 0;     // that are to be run now
    std::int64_t done = 0;     // that were
    std::int64_t end = all_ticks_done;
};

// Run up to `most` ticks, until an action ends.
void run(Plant& plant);

}  // namespace mobee
