// SPDX-License-Identifier: Apache-2.0
// The offline plant: the loop of encoders, model, law and motors of one robot.
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

// The last columns of a record's row: the deepest contact of each kind [m].  The columns before are encoders, joint sides and commanded
// velocities, each (n,).
constexpr std::int64_t record_depths = 2;

// The caller owns the memory.
struct Plant {
    Neighbours* neighbours = nullptr;  // of the robot in the world; null: contacts are not computed
    const Law* law = nullptr;
    LawState* law_state = nullptr;
    double* attractor = nullptr;     // (n,)
    const double* client = nullptr;  // (n,), the bounded forces f_config and f_work of the client
    double* forces = nullptr;        // (rows, n), the law's terms; the caller may give further rows for one tick
    std::int64_t rows = 0;
    View<Reach* const> reaches;
    Motors* motors = nullptr;
    double* commands = nullptr;  // (command_age, n), the commands that have not reached the motors yet
    std::int64_t command_age = 1;
    std::int64_t substeps = 1;
    double dt = 0.0;  // s, length of a tick
    const double* noise = nullptr;  // (n,), standard deviations of the encoders' noise; null: no noise
    View<PartAction> parts;
    double* q = nullptr;       // (n,), the encoders of the last tick
    double* torque = nullptr;  // (n,), the sum of J^T (depth * normal) at q
    double* total = nullptr;   // (n,), the right-hand side of eq. 5.7
    double* record = nullptr;  // (max_ticks, 3 n + record_depths), a row for each tick; null: no record
    double* deepest = nullptr;  // (record_depths,), raised to the depths of the contacts of every tick; null: not wanted
    std::int64_t ticks = 0;    // number of ticks so far
    std::int64_t max_ticks = 0;     // number of ticks to run
    std::int64_t ticks_run = 0;     // number of ticks of this run so far
    std::int64_t end = all_ticks_done;
};

namespace plant {

// Send the motors the command that is `command_age` ticks old.
void apply_command(Plant& plant, std::int64_t tick) {
    if (tick <= plant.command_age) return;
    const double* command = plant.commands + tick % plant.command_age * plant.law->motors.size;
    for (const std::int64_t i : plant.motors->living) {
        plant.motors->state[i].reference = command[i];
        set_mode(*plant.motors, i, plant.law->modality);
    }
}

// Read the encoders into q.  Return false if a value is not finite.
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

// Find the contacts at q and compute their torque on the motors.  Return the number of contacts.
std::int64_t update_contacts(Plant& plant) {
    std::fill_n(plant.torque, plant.law->motors.size, 0.0);
    const std::int64_t count = find(*plant.neighbours, plant.q);
    if (count > 0) project_contacts(*plant.neighbours, plant.torque);
    return count;
}

// Compute the forces, advance the law by a step, and write the command of a tick.
void compute_command(Plant& plant, std::int64_t tick, bool has_contacts) {
    const Law& law = *plant.law;
    const std::int64_t n = law.motors.size;
    constraining_forces(law, {plant.q, plant.torque, plant.law_state, has_contacts}, plant.forces);
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

// Return whether an action has ended, according to the encoders of time `sampled` [s].
bool check_actions(Plant& plant, double sampled) {
    bool ended = false;
    for (PartAction& part : plant.parts) {
        if (!part.under_way) continue;
        const Verdict verdict = check_settled(*plant.law, part.motors, plant.law_state, sampled, part.test);
        if (verdict == moving || (verdict == settled && is_approaching(*plant.law, plant.reaches, part.motors.first))) continue;
        part.under_way = 0;
        part.verdict = verdict;
        ended = true;
    }
    return ended;
}

// Raise the deepest contact of each kind to those of the last tick.
void raise_depths(const Plant& plant, std::int64_t contacts, double* deepest) {
    for (std::int64_t c = 0; c < contacts; ++c) {
        const Contact& contact_k = contact(*plant.neighbours, c);
        deepest[contact_k.kind] = std::max(deepest[contact_k.kind], contact_k.depth);
    }
}

void write_record(const Plant& plant, std::int64_t contacts, double* row) {
    const std::int64_t n = plant.law->motors.size;
    for (std::int64_t i = 0; i < n; ++i) {
        row[i] = plant.q[i];
        row[n + i] = plant.motors->state[i].q;
        row[2 * n + i] = plant.law_state[i].velocity;
    }
    std::fill_n(row + 3 * n, record_depths, 0.0);
    raise_depths(plant, contacts, row + 3 * n);
}

}  // namespace plant

// Run up to `max_ticks` ticks, until an action ends.
void run(Plant& plant) {
    const std::int64_t width = 3 * plant.law->motors.size + record_depths;
    plant.end = all_ticks_done;
    for (plant.ticks_run = 0; plant.ticks_run < plant.max_ticks;) {
        const std::int64_t tick = plant.ticks + 1;
        plant::apply_command(plant, tick);
        if (!plant::measure(plant, tick)) {
            plant.end = state_lost;
            return;
        }
        const std::int64_t contacts = plant.neighbours != nullptr ? plant::update_contacts(plant) : 0;
        plant::compute_command(plant, tick, contacts > 0);
        move(*plant.motors, plant.substeps, plant.dt / static_cast<double>(plant.substeps));
        if (plant.record != nullptr) plant::write_record(plant, contacts, plant.record + plant.ticks_run * width);
        if (plant.deepest != nullptr) plant::raise_depths(plant, contacts, plant.deepest);
        plant.ticks = tick;
        ++plant.ticks_run;
        const double sampled = static_cast<double>(tick) * plant.dt - plant.dt;
        if (plant::check_actions(plant, sampled)) {
            plant.end = action_ended;
            return;
        }
    }
}

MOBEE_CALL void mobee_plant_run(Plant* plant) { run(*plant); }

// Run distinct plants as `mobee_plant_run` does, in `threads` threads.
MOBEE_CALL void mobee_plants_run(Plant* const* plants, std::int64_t count, std::int64_t threads) {
    share(count, 1, std::min(threads, count), [&](std::int64_t, std::int64_t which, std::int64_t) { run(*plants[which]); });
}

// Run distinct plants for `ticks` ticks each, also if actions end before, in `threads` threads; a plant whose state is lost ends there.
MOBEE_CALL void mobee_plants_run_for(Plant* const* plants, std::int64_t count, std::int64_t ticks, std::int64_t threads) {
    share(count, 1, std::min(threads, count), [&](std::int64_t, std::int64_t which, std::int64_t) {
        Plant& plant = *plants[which];
        plant.max_ticks = ticks;
        do {
            run(plant);
            plant.max_ticks -= plant.ticks_run;
        } while (plant.end == action_ended && plant.max_ticks > 0);
    });
}

// Fill the encoders, attractors and velocities of all motors of several plants, (plants, 3, motors).
MOBEE_CALL void mobee_plants_read(const Plant* const* plants, std::int64_t count, double* out) {
    for (const Plant* const* plant = plants; plant != plants + count; ++plant) {
        const std::int64_t n = (*plant)->law->motors.size;
        std::copy_n((*plant)->q, n, out);
        std::copy_n((*plant)->attractor, n, out + n);
        for (std::int64_t i = 0; i < n; ++i) out[2 * n + i] = (*plant)->law_state[i].velocity;
        out += 3 * n;
    }
}

// Set the attractors of several plants, (plants, motors), as goals that do not move.
MOBEE_CALL void mobee_plants_aim(Plant* const* plants, std::int64_t count, const double* attractors) {
    for (Plant* const* plant = plants; plant != plants + count; ++plant) {
        const std::int64_t n = (*plant)->law->motors.size;
        std::copy_n(attractors, n, (*plant)->attractor);
        for (std::int64_t i = 0; i < n; ++i) (*plant)->law_state[i].goal_time = 0.0;
        attractors += n;
    }
}

// Fill the size in bytes of each structure that Python declares too, in the order of `STRUCTURES` in mobee/_core/plant.py.
MOBEE_CALL void mobee_plant_sizes(std::int64_t* sizes) {
    for (const std::size_t size :
         {sizeof(MotorGains), sizeof(ClauseRow), sizeof(ClauseEntry), sizeof(LawState), sizeof(Law), sizeof(ReachDrive), sizeof(ReachJoint),
          sizeof(PulledMotor), sizeof(Reach), sizeof(MotorConstants), sizeof(MotorState), sizeof(Motors), sizeof(PartAction), sizeof(Plant)})
        *sizes++ = static_cast<std::int64_t>(size);
}

}  // namespace mobee
