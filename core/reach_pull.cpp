// SPDX-License-Identifier: Apache-2.0
// The default reach law: the marker comes nearer at one rate in every direction, wherever the arm is.
//
// The force on the marker is (J E J^T + damping)^-1 times what is missing, E how much each motor gives way, and so weak that the bend
// of the marker's path does not make it swing.  In a singular pose, where J^T f is zero, motors are nudged along a way on which the
// error falls on both sides.  What holds the motors back, limits, clauses or contacts, is a wall along which the marker goes on.
#include <algorithm>
#include <cmath>

#include "reach.hpp"

namespace mobee {

namespace pull {

constexpr double rate = 5.0;        // 1/s: far below what swings with commands three ticks old at 100 Hz (docs/law.md)
constexpr double arm = 0.1;         // m: a normal that is wrong by an angle counts as a position wrong by this times the angle
constexpr double softness = 0.03;   // of the size of J E J^T: damping
constexpr int softer = 60;          // times at most that it is doubled: more than any finite force needs
constexpr double nothing = 1e-12;   // m^2/s, what a marker gives that nothing moves
constexpr double longest = 0.2;     // m: beyond it the pull grows no more
constexpr double tolerance = 2e-3;  // m
constexpr double weakness = 0.05;   // of the error's force that arrives at the motors: below it the pose is singular
constexpr double nudge = 0.1;       // rad, out of a singular pose
constexpr double smooth = 0.25;     // s, over which the error is averaged before it is judged
constexpr double patience = 3.0;    // s without coming nearer: no way out is tried any more
constexpr double wait = 0.6;        // s: what has come nearer since has not arrived
constexpr double better = 5e-4;     // m, that count as nearer
constexpr double wall = 0.5;        // rad/s^2: what holds the motors back half counts as a wall where it is that strong
constexpr double curved = 1e-3;     // of the size of J E J^T: curvature that counts
constexpr double probe_size = 1e-4; // rad
constexpr int few_turns = 12, turns = 60;  // of the power iteration

// What a row of the Jacobian counts [m]: 1 for positions, `arm` for normals.
constexpr double weight(int row) { return row < 3 ? 1.0 : arm; }

// The equations of the force on the marker: J E J^T, its triangular root, and the force.
struct Push {
    double give[6][6];
    double root[6][6];
    double force[6];
};

// Average the error, keep for how long it has not become less; what is missing [m].
double note_missing(Reach& reach, double dt) {
    const double share = reach.begun ? std::min(1.0, dt / smooth) : 1.0;
    double squares = 0.0;
    for (int row = 0; row < reach.rows(); ++row) {
        reach.seen[row] += (weight(row) * reach.error[row] - reach.seen[row]) * share;
        squares += reach.seen[row] * reach.seen[row];
    }
    const double missing = std::sqrt(squares);
    if (!reach.begun || missing < reach.best - better) {
        reach.best = missing;
        reach.since = 0.0;
    }
    reach.begun = 1;
    reach.since += dt;
    reach.left = missing;
    return missing;
}

void find_slopes(Reach& reach) {
    for (PulledMotor& motor : reach.motors) {
        motor.slope = 0.0;
        for (int row = 0; row < reach.rows(); ++row) motor.slope += weight(row) * weight(row) * motor.column[row] * reach.error[row];
    }
}

// Slope of the squash over damping; 0 for a motor that a limit keeps.
void ease_motors(const Law& law, Reach& reach, const double* q) {
    for (PulledMotor& motor : reach.motors) {
        const MotorGains& gains = law.motors[motor.motor];
        const double here = q[motor.motor];
        const double low = gains.low + 0.5 * gains.below, high = gains.high - 0.5 * gains.above;
        const bool kept = (here < low && motor.slope < 0.0) || (here > high && motor.slope > 0.0);
        motor.ease = kept ? 0.0 : gains.client_slope / gains.damping;
    }
}

// Fill J E J^T; its size.
double fill_give(const Reach& reach, Push& push) {
    double squares = 0.0;
    for (int a = 0; a < reach.rows(); ++a) {
        for (int b = 0; b < reach.rows(); ++b) {
            double total = 0.0;
            for (const PulledMotor& motor : reach.motors) total += motor.column[a] * motor.ease * motor.column[b];
            total *= weight(a) * weight(b);
            push.give[a][b] = total;
            squares += total * total;
        }
    }
    return std::max(std::sqrt(squares), nothing);
}

// Replace the force by the solution of (J E J^T / size + soft) x = force (Cholesky).
void solve(Push& push, int rows, double size, double soft) {
    auto& root = push.root;
    double* x = push.force;
    for (int a = 0; a < rows; ++a) {
        for (int b = 0; b <= a; ++b) {
            double total = push.give[a][b] / size + (a == b ? soft : 0.0);
            for (int c = 0; c < b; ++c) total -= root[a][c] * root[b][c];
            root[a][b] = a == b ? std::sqrt(total) : total / root[b][b];
        }
    }
    for (int a = 0; a < rows; ++a) {
        for (int c = 0; c < a; ++c) x[a] -= root[a][c] * x[c];
        x[a] /= root[a][a];
    }
    for (int a = rows - 1; a >= 0; --a) {
        for (int c = a + 1; c < rows; ++c) x[a] -= root[c][a] * x[c];
        x[a] /= root[a][a];
    }
}

// No less than `bend`, at little cost: for joints i before j the path's second derivative is the axis of i times the motion of j.
double bend_at_most(const Reach& reach, const Push& push) {
    double levers = 0.0, axes = 0.0, force = 0.0, twist = 0.0;
    for (const PulledMotor& motor : reach.motors) {
        for (int row = 0; row < 3; ++row) {
            levers += motor.column[row] * motor.column[row] * motor.ease;
            axes += motor.column[3 + row] * motor.column[3 + row] * motor.ease;
        }
    }
    for (int row = 0; row < 3; ++row) {
        force += push.force[row] * push.force[row];
        if (reach.turned) twist += push.force[3 + row] * push.force[3 + row];
    }
    return std::sqrt(force * levers * axes) + arm * std::sqrt(twist) * axes;
}

// The force times the second derivative of the marker's pose along joint a, the nearer to the base, and b.
double bend_of(const Reach& reach, const Push& push, std::int64_t a, std::int64_t b) {
    const ReachJoint &first = reach.joints[a], &second = reach.joints[b];
    const Vec3 force = {push.force[0], push.force[1], push.force[2]};
    const double found = dot(force, cross(first.turning, second.motion));
    if (!reach.turned || a == b) return found;
    const Vec3 twist = {push.force[3], push.force[4], push.force[5]};
    return found + 0.5 * arm * dot(twist, cross(first.turning, second.turning));
}

// The largest eigenvalue of the matrix times `sign`, all of them within +-`shift`; its vector in `vector`, where it starts.
double largest(Reach& reach, double shift, double sign, double PulledMotor::* vector, int count) {
    const std::int64_t moved = reach.motors.size;
    double length = 0.0;
    for (int turn = 0; turn < count; ++turn) {
        double squares = 0.0;
        for (std::int64_t k = 0; k < moved; ++k) {
            PulledMotor& motor = reach.motors[k];
            motor.force = shift * motor.*vector;
            for (std::int64_t m = 0; m < moved; ++m) motor.force += sign * reach.curve[k * moved + m] * reach.motors[m].*vector;
            squares += motor.force * motor.force;
        }
        length = std::sqrt(squares);
        for (PulledMotor& motor : reach.motors) motor.*vector = length > 0.0 && motor.ease > 0.0 ? motor.force / length : 0.0;
    }
    return length - shift;
}

// Add what the bend along joints a and b is for each pair of motors that drive them to the matrix.
void add_bend(Reach& reach, std::int64_t a, std::int64_t b, double along) {
    const std::int64_t moved = reach.motors.size;
    const Interval first = reach.joints[a].drives, second = reach.joints[b].drives;
    for (std::int64_t c = first.first; c < first.end; ++c) {
        for (std::int64_t d = second.first; d < second.end; ++d) {
            const ReachDrive &one = reach.drives[c], &two = reach.drives[d];
            const double both = one.lever * two.lever;
            if (both == 0.0) continue;
            const double value = -along * both * std::sqrt(reach.motors[one.pulled].ease * reach.motors[two.pulled].ease);
            reach.curve[one.pulled * moved + two.pulled] += value;
            if (a != b) reach.curve[two.pulled * moved + one.pulled] += value;
        }
    }
}

// What the bend of the marker's path adds to the stiffness of the force at most, along any motion, as the motors give way.
double bend(Reach& reach, const Push& push) {
    const std::int64_t moved = reach.motors.size;
    std::fill_n(reach.curve, moved * moved, 0.0);
    for (std::int64_t a = 0; a < reach.used; ++a)
        for (std::int64_t b = a; b < reach.used; ++b)
            if (reach.joints[a].pulled && reach.joints[b].pulled) add_bend(reach, a, b, bend_of(reach, push, a, b));
    double squares = 0.0;
    for (std::int64_t k = 0; k < moved; ++k) {
        for (std::int64_t m = 0; m < moved; ++m) squares += reach.curve[k * moved + m] * reach.curve[k * moved + m];
        reach.motors[k].bent = 1.0 + 0.1 * static_cast<double>(k);
    }
    return largest(reach, std::sqrt(squares), 1.0, &PulledMotor::bent, few_turns);
}

// The force on the marker: as much in every direction as gives the rate, less where the bend of its path would make it swing.
void push_marker(Reach& reach, Push& push, double size, double scale) {
    double soft = softness;
    for (int time = 0; time < softer; ++time) {
        for (int row = 0; row < reach.rows(); ++row) push.force[row] = rate * scale * weight(row) * reach.error[row] / size;
        solve(push, reach.rows(), size, soft);
        if (bend_at_most(reach, push) < rate || bend(reach, push) < rate) return;
        soft *= 2.0;
    }
}

// J^T of the force on the marker.
void force_motors(Reach& reach, const Push& push) {
    for (PulledMotor& motor : reach.motors) {
        motor.force = 0.0;
        for (int row = 0; row < reach.rows(); ++row) motor.force += weight(row) * motor.column[row] * push.force[row];
    }
}

// How fast the force moves the motors along what holds them back; below 0: into it.
double speed_of_held(const Reach& reach) {
    double speed = 0.0;
    for (const PulledMotor& motor : reach.motors) speed += motor.held * motor.ease * motor.force;
    return speed;
}

// Split what acts against the force: the limit of each motor, and the rest; whether any of it does.
bool is_held_back(const Law& law, Reach& reach, const double* q, const double* against) {
    bool limited = false;
    for (PulledMotor& motor : reach.motors) {
        const MotorGains& gains = law.motors[motor.motor];
        const double limit = limit_force(gains, q[motor.motor]);
        motor.limited = limit * motor.force < 0.0 ? std::fabs(limit) / gains.unit : 0.0;
        motor.held = (against[motor.motor] - limit) / gains.unit;
        limited = limited || motor.limited > 0.0;
    }
    return limited || speed_of_held(reach) < 0.0;
}

// Take `held` as a direction in which the motors give no way, the less the weaker it is; how much of it is taken.
double face_wall(const Reach& reach, Push& push) {
    double squares = 0.0, across = 0.0;
    for (const PulledMotor& motor : reach.motors) {
        squares += motor.held * motor.held;
        across += motor.held * motor.ease * motor.held;
    }
    if (across == 0.0) return 0.0;
    const double length = std::sqrt(squares);
    const double share = length / (length + wall) / across;
    double away[6] = {};
    for (int row = 0; row < reach.rows(); ++row)
        for (const PulledMotor& motor : reach.motors) away[row] += weight(row) * motor.column[row] * motor.ease * motor.held;
    for (int a = 0; a < reach.rows(); ++a)
        for (int b = 0; b < reach.rows(); ++b) push.give[a][b] -= share * away[a] * away[b];
    return share;
}

// Fill the forces again for motors that are held back: along the wall, not into it.
void slide(Reach& reach, Push& push, double size, double scale) {
    const double before = speed_of_held(reach);
    for (PulledMotor& motor : reach.motors) motor.ease *= wall / (wall + motor.limited);
    fill_give(reach, push);
    const double share = before < 0.0 ? face_wall(reach, push) : 0.0;
    push_marker(reach, push, size, scale);
    force_motors(reach, push);
    const double speed = speed_of_held(reach);
    for (PulledMotor& motor : reach.motors)
        motor.force = (motor.force - share * speed * motor.held) * wall / (wall + motor.limited);
}

void see_from(Reach& reach, const double* q) {
    place_marker(reach, q);
    note_error(reach);
    find_slopes(reach);
}

// Fill how half the square of the error curves along pairs of motors, as they give way; its size.
double curve(const Law& law, Reach& reach, double* q) {
    const std::int64_t moved = reach.motors.size;
    for (std::int64_t k = 0; k < moved; ++k) {
        const std::int64_t i = reach.motors[k].motor;
        const double here = q[i], probe = probe_size * law.motors[i].unit;
        double* row = reach.curve + k * moved;
        q[i] = here + probe;
        see_from(reach, q);
        for (std::int64_t m = 0; m < moved; ++m) row[m] = reach.motors[m].slope;
        q[i] = here + -probe;
        see_from(reach, q);
        for (std::int64_t m = 0; m < moved; ++m) row[m] = (reach.motors[m].slope - row[m]) / (2.0 * probe_size);
        q[i] = here;
    }
    double squares = 0.0;
    for (std::int64_t k = 0; k < moved; ++k) {
        for (std::int64_t m = 0; m <= k; ++m) {
            double &one = reach.curve[k * moved + m], &two = reach.curve[m * moved + k];
            const double both = 0.5 * (one + two) * std::sqrt(reach.motors[k].ease * reach.motors[m].ease);
            one = two = both;
            squares += k == m ? both * both : 2.0 * both * both;
        }
    }
    see_from(reach, q);
    return std::sqrt(squares);
}

// From a pose that the pull does not move: the way along which the error falls on both sides; false if there is none.
bool find_way(const Law& law, Reach& reach, double* q, double size) {
    const double shift = curve(law, reach, q);
    for (std::int64_t k = 0; k < reach.motors.size; ++k) {
        reach.motors[k].before = reach.motors[k].way;
        reach.motors[k].way = 1.0 + 0.1 * static_cast<double>(k);
    }
    if (largest(reach, shift, -1.0, &PulledMotor::way, turns) < curved * size) {
        for (PulledMotor& motor : reach.motors) motor.way = 0.0;
        return false;
    }
    double before = 0.0, middle = 0.0;
    for (const PulledMotor& motor : reach.motors) {
        const MotorGains& gains = law.motors[motor.motor];
        before += motor.way * motor.before;
        middle += motor.way * (0.5 * (gains.low + gains.high) - q[motor.motor]);
    }
    if (before < 0.0 || (before == 0.0 && middle < 0.0))
        for (PulledMotor& motor : reach.motors) motor.way = -motor.way;
    return true;
}

}  // namespace pull

bool pull_marker(const Law& law, Reach& reach, double* q, double dt, const double* against) {
    const double missing = pull::note_missing(reach, dt);
    pull::find_slopes(reach);
    pull::ease_motors(law, reach, q);
    pull::Push push;
    const double size = pull::fill_give(reach, push);
    double squares = 0.0, arriving = 0.0;
    for (int row = 0; row < reach.rows(); ++row)
        squares += pull::weight(row) * reach.error[row] * pull::weight(row) * reach.error[row];
    for (const PulledMotor& motor : reach.motors) arriving += motor.slope * motor.ease * motor.slope;
    const bool weak = arriving < pull::weakness * pull::weakness * size * squares;
    const bool lost = weak && missing > pull::tolerance && reach.since <= pull::patience;
    const bool nudged = lost && pull::find_way(law, reach, q, size);
    const double fading = missing / (missing + 0.5 * pull::tolerance);  // so that at the target the encoders' noise is not followed
    const double scale = fading / (1.0 + std::sqrt(squares) / pull::longest);
    pull::push_marker(reach, push, size, scale);
    pull::force_motors(reach, push);
    if (pull::is_held_back(law, reach, q, against)) pull::slide(reach, push, size, scale);
    return nudged;
}

void add_release(const Law& law, const Reach& reach, bool nudged, const double* q, const double* attractor, double* total) {
    for (const PulledMotor& motor : reach.motors) {
        const std::int64_t i = motor.motor;
        const MotorGains& gains = law.motors[i];
        total[i] -= squash(attractor[i] - q[i], gains.max_spring, gains.spring_knee);
        if (nudged) total[i] += squash(pull::nudge * motor.way * gains.unit, gains.max_spring, gains.spring_knee);
    }
}

bool nears(const Reach& reach) { return reach.left > 0.75 * pull::tolerance && reach.since < pull::wait; }

}  // namespace mobee
