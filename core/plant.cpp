#include "plant.hpp"

#include <algorithm>
#include <cmath>
#include <initializer_list>
#include <limits>

#include "interface.hpp"
#include "threads.hpp"

namespace mobee {

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

// What one of several threads does: it runs one plant after the other as long as there are any.
struct Runner {
    Plant* const* plants;
    Blocks* blocks;

    void run() {
        for (std::int64_t begin, end; blocks->take(begin, end);) mobee::run(*plants[begin]);
    }
};

}  // namespace plant

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

}  // namespace mobee

MOBEE_CALL void mobee_plant_run(mobee::Plant* plant) { mobee::run(*plant); }

// Run plants of which no two are the same, each as by `mobee_plant_run`, in so many threads.
MOBEE_CALL void mobee_plants_run(mobee::Plant* const* plants, std::int64_t count, std::int64_t threads) {
    mobee::Blocks blocks(count, 1);
    mobee::plant::Runner runner{plants, &blocks};
    mobee::Array<mobee::plant::Runner*> runners;
    for (std::int64_t k = 0; k < threads && k < count; ++k) runners.push(&runner);
    if (runners.size() > 0) mobee::run_together(runners);
}

// How many bytes each structure that Python lays out takes, in the order of `STRUCTURES` in mobee/_core/plant.py.
MOBEE_CALL void mobee_plant_sizes(std::int64_t* sizes) {
    using mobee::ClauseEntry, mobee::ClauseRow, mobee::Law, mobee::LawState, mobee::MotorGains, mobee::MotorNumbers, mobee::Motors;
    using mobee::MotorState, mobee::PartAction, mobee::Plant, mobee::PulledMotor, mobee::Reach, mobee::ReachDrive, mobee::ReachJoint;
    for (const std::size_t size :
         {sizeof(MotorGains), sizeof(ClauseRow), sizeof(ClauseEntry), sizeof(LawState), sizeof(Law), sizeof(ReachDrive), sizeof(ReachJoint),
          sizeof(PulledMotor), sizeof(Reach), sizeof(MotorNumbers), sizeof(MotorState), sizeof(Motors), sizeof(PartAction), sizeof(Plant)})
        *sizes++ = static_cast<std::int64_t>(size);
}
