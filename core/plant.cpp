// SPDX-License-Identifier: Apache-2.0
// The offline plant: encoders, model, law and motors of one robot, tick after tick.
#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>

#include "interface.hpp"
#include "law.hpp"
#include "motors.hpp"
#include "neighbours.hpp"
#include "reach.hpp"
#include "threads.hpp"

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

namespace plant {

// Let the command that is old enough come into force.
void tell(Plant& plant, std::int64_t tick) {
    if (tick <= plant.command_age) return;
    const double* command = plant.commands + tick % plant.command_age * plant.law->motors.size;
    for (const std::int64_t i : plant.motors->living) {
        plant.motors->state[i].reference = command[i];
        enter(*plant.motors, i, plant.law->modality);
    }
}

// Read the encoders; false if they are not finite.
bool measure(Plant& plant, std::int64_t tick) {
    Motors& motors = *plant.motors;
    if (plant.noise != nullptr) {
        read_encoders(motors, tick, plant.noise, plant.q);
    } else {
        for (const std::int64_t i : motors.living) plant.q[i] = motors.state[i].q;
    }
    double total = 0.0;
    for (const std::int64_t i : motors.living) total += std::fabs(plant.q[i]);
    return total < std::numeric_limits<double>::infinity();
}

// Find the contacts of the pose and what they do to the motors; how many there are.
std::int64_t feel_pose(Plant& plant) {
    std::fill_n(plant.torque, plant.law->motors.size, 0.0);
    const std::int64_t count = find(*plant.near, plant.q);
    if (count > 0) feel(*plant.near, plant.torque);
    return count;
}

// Form the command of a tick: the forces, and a step of the law.
void respond(Plant& plant, std::int64_t tick, bool touched) {
    const Law& law = *plant.law;
    const std::int64_t n = law.motors.size;
    constraining_forces(law, {plant.q, plant.torque, plant.law_state, touched}, plant.forces);
    for (const std::int64_t i : plant.motors->living) {
        double total = plant.forces[i];
        for (std::int64_t row = 1; row < plant.rows; ++row) total += plant.forces[row * n + i];
        plant.total[i] = total + plant.client[i];
    }
    add_reaches(law, plant.reaches, plant.q, plant.attractor, plant.dt, plant.total);
    advance(law, plant.q, plant.dt, plant.attractor, plant.total, plant.law_state);
    double* command = plant.commands + tick % plant.command_age * n;
    for (const std::int64_t i : plant.motors->living) {
        const LawState& state = plant.law_state[i];
        command[i] = law.modality == velocity_modality   ? state.velocity
                     : law.modality == position_modality ? state.reference
                                                         : torque_of(law.motors[i], state);
    }
}

// Whether an action has ended, by what the encoders said at time `sampled` [s].
bool judge(Plant& plant, double sampled) {
    bool ended = false;
    for (PartAction& part : plant.parts) {
        if (!part.under_way) continue;
        const Verdict verdict = look(*plant.law, part.motors, plant.law_state, sampled, part.test);
        if (verdict == moving || (verdict == settled && goes_on(*plant.law, plant.reaches, part.motors.first))) continue;
        part.under_way = 0;
        part.verdict = verdict;
        ended = true;
    }
    return ended;
}

void write(const Plant& plant, std::int64_t contacts, double* row) {
    const std::int64_t n = plant.law->motors.size;
    for (std::int64_t i = 0; i < n; ++i) {
        row[i] = plant.q[i];
        row[n + i] = plant.motors->state[i].q;
        row[2 * n + i] = plant.law_state[i].velocity;
    }
    double* deepest = row + 3 * n;
    std::fill_n(deepest, record_depths, 0.0);
    for (std::int64_t c = 0; c < contacts; ++c) {
        const Contact& found = contact(*plant.near, c);
        deepest[found.kind] = std::max(deepest[found.kind], found.depth);
    }
}

}  // namespace plant

// Run up to `most` ticks, until an action ends.
void run(Plant& plant) {
    const std::int64_t width = 3 * plant.law->motors.size + record_depths;
    plant.end = all_ticks_done;
    for (plant.done = 0; plant.done < plant.most; ++plant.done) {
        const std::int64_t tick = plant.ticks + plant.done + 1;
        plant::tell(plant, tick);
        if (!plant::measure(plant, tick)) {
            plant.end = state_lost;
            return;
        }
        const std::int64_t contacts = plant.near != nullptr ? plant::feel_pose(plant) : 0;
        plant::respond(plant, tick, contacts > 0);
        move(*plant.motors, plant.substeps, plant.dt / static_cast<double>(plant.substeps));
        if (plant.record != nullptr) plant::write(plant, contacts, plant.record + plant.done * width);
        const double sampled = static_cast<double>(tick) * plant.dt - plant.dt;
        if (plant::judge(plant, sampled)) {
            ++plant.done;
            plant.end = action_ended;
            return;
        }
    }
}

MOBEE_CALL void mobee_plant_run(Plant* plant) { run(*plant); }

// Run plants of which no two are the same, each as by `mobee_plant_run`, in so many threads.
MOBEE_CALL void mobee_plants_run(Plant* const* plants, std::int64_t count, std::int64_t threads) {
    share(count, 1, std::min(threads, count), [&](std::int64_t, std::int64_t which, std::int64_t) { run(*plants[which]); });
}

// How many bytes each structure that Python lays out takes, in the order of `STRUCTURES` in mobee/_core/plant.py.
MOBEE_CALL void mobee_plant_sizes(std::int64_t* sizes) {
    for (const std::size_t size :
         {sizeof(MotorGains), sizeof(ClauseRow), sizeof(ClauseEntry), sizeof(LawState), sizeof(Law), sizeof(ReachDrive), sizeof(ReachJoint),
          sizeof(PulledMotor), sizeof(Reach), sizeof(MotorNumbers), sizeof(MotorState), sizeof(Motors), sizeof(PartAction), sizeof(Plant)})
        *sizes++ = static_cast<std::int64_t>(size);
}

}  // namespace mobee
