// SPDX-License-Identifier: Apache-2.0
// The default reach law: the error of the marker decays at one rate in every direction, in all poses that are not singular.
//
// The force on the marker is (J E J^T + damping)^-1 times the error.  E is the diagonal matrix of the motors' mobilities.  The damping is
// raised where the curvature of the marker's path would make the marker oscillate.  In a singular pose, where J^T f is zero, springs move
// the motors along a direction in which the error decreases both forward and backward.  Limits, clauses and contacts that oppose the
// force are treated as a wall, and the marker slides along it.
#include <algorithm>
#include <cmath>

#include "reach.hpp"

namespace mobee {

namespace pull {

constexpr double rate = 5.0;        // 1/s; far below the rate that oscillates with commands three ticks old at 100 Hz (docs/law.md)
constexpr double arm = 0.1;         // m; an angular error of the normal counts as a position error of this length times the angle
constexpr double relative_damping = 0.03;   // least damping, relative to the Frobenius norm of J E J^T
constexpr int max_doublings = 60;          // of the damping; more than any finite force needs
constexpr double min_mobility = 1e-12;   // m^2/s; lower bound of the norm of J E J^T, for a marker that no motor moves
constexpr double saturation_length = 0.2;     // m; the force is half of its bound at this error
constexpr double tolerance = 2e-3;  // m, error of a reached target
constexpr double singular_share = 0.05;   // a pose is singular if less than this share of the force on the marker moves the motors
constexpr double escape_step = 0.1;       // rad, distance of the springs' goal in a singular pose
constexpr double smoothing_time = 0.25;     // s, time constant of the average of the error
constexpr double escape_timeout = 3.0;    // s without progress, after which no escape from a singular pose is tried
constexpr double stall_time = 0.6;        // s without progress, after which a reach has ended
constexpr double min_progress = 5e-4;     // m, decrease of the error that counts as progress
constexpr double wall_force = 0.5;        // rad/s^2; an opposing force of this size halves the mobility along it
constexpr double min_curvature = 1e-3;     // least curvature of an escape direction, relative to the norm of J E J^T
constexpr double probe_size = 1e-4;  // rad, of finite differences
constexpr int bend_iterations = 12, escape_iterations = 60;  // iterations of the power method

// Return the weight of a row of the Jacobian: 1 for positions, `arm` [m] for normals.
constexpr double weight(int row) { return row < 3 ? 1.0 : arm; }

// The linear system for the force on the marker: J E J^T, its Cholesky factor, and the force.
struct Push {
    double mobility[6][6];
    double root[6][6];
    double force[6];
};

// Update the smoothed error and the time without progress.  Return the length of the smoothed error [m].
double smooth_error(Reach& reach, double dt) {
    const double share = reach.started ? std::min(1.0, dt / smoothing_time) : 1.0;
    double squares = 0.0;
    for (int row = 0; row < reach.rows(); ++row) {
        reach.smoothed_error[row] += (weight(row) * reach.error[row] - reach.smoothed_error[row]) * share;
        squares += reach.smoothed_error[row] * reach.smoothed_error[row];
    }
    const double remaining = std::sqrt(squares);
    if (!reach.started || remaining < reach.least_distance - min_progress) {
        reach.least_distance = remaining;
        reach.time_without_progress = 0.0;
    }
    reach.started = 1;
    reach.time_without_progress += dt;
    reach.smoothed_distance = remaining;
    return remaining;
}

void compute_descent(Reach& reach) {
    for (PulledMotor& motor : reach.motors) {
        motor.descent = 0.0;
        for (int row = 0; row < reach.rows(); ++row) motor.descent += weight(row) * weight(row) * motor.column[row] * reach.error[row];
    }
}

// Compute the mobility of each motor: slope of the squash divided by damping; 0 for a motor that a limit blocks.
void compute_mobility(const Law& law, Reach& reach, const double* q) {
    for (PulledMotor& motor : reach.motors) {
        const MotorGains& gains = law.motors[motor.motor];
        const double here = q[motor.motor];
        const double low = gains.low + 0.5 * gains.low_zone, high = gains.high - 0.5 * gains.high_zone;
        const bool is_blocked = (here < low && motor.descent < 0.0) || (here > high && motor.descent > 0.0);
        motor.mobility = is_blocked ? 0.0 : gains.client_slope / gains.damping;
    }
}

// Fill J E J^T.  Return its Frobenius norm.
double compute_marker_mobility(const Reach& reach, Push& push) {
    double squares = 0.0;
    for (int a = 0; a < reach.rows(); ++a) {
        for (int b = 0; b < reach.rows(); ++b) {
            double total = 0.0;
            for (const PulledMotor& motor : reach.motors) total += motor.column[a] * motor.mobility * motor.column[b];
            total *= weight(a) * weight(b);
            push.mobility[a][b] = total;
            squares += total * total;
        }
    }
    return std::max(std::sqrt(squares), min_mobility);
}

// Replace the force by the solution of (J E J^T / size + damping) x = force (Cholesky).
void solve(Push& push, int rows, double size, double damping) {
    auto& root = push.root;
    double* x = push.force;
    for (int a = 0; a < rows; ++a) {
        for (int b = 0; b <= a; ++b) {
            double total = push.mobility[a][b] / size + (a == b ? damping : 0.0);
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

// Return an upper bound of `max_bend` at low cost.  For joints i before j, the second derivative of the marker's path is the cross product
// of the axis of i and the motion of j.
double bend_bound(const Reach& reach, const Push& push) {
    double levers = 0.0, axes = 0.0, force = 0.0, normal_force = 0.0;
    for (const PulledMotor& motor : reach.motors) {
        for (int row = 0; row < 3; ++row) {
            levers += motor.column[row] * motor.column[row] * motor.mobility;
            axes += motor.column[3 + row] * motor.column[3 + row] * motor.mobility;
        }
    }
    for (int row = 0; row < 3; ++row) {
        force += push.force[row] * push.force[row];
        if (reach.turns_normal) normal_force += push.force[3 + row] * push.force[3 + row];
    }
    return std::sqrt(force * levers * axes) + arm * std::sqrt(normal_force) * axes;
}

// Return the dot product of the force and the second derivative of the marker's pose along joints a and b; a is nearer to the base.
double joint_bend(const Reach& reach, const Push& push, std::int64_t a, std::int64_t b) {
    const ReachJoint &first = reach.joints[a], &second = reach.joints[b];
    const Vec3 force = {push.force[0], push.force[1], push.force[2]};
    const double bend = dot(force, cross(first.angular, second.linear));
    if (!reach.turns_normal || a == b) return bend;
    const Vec3 normal_force = {push.force[3], push.force[4], push.force[5]};
    return bend + 0.5 * arm * dot(normal_force, cross(first.angular, second.angular));
}

// Return the largest eigenvalue of `sign` times the curvature matrix by the power method.  All eigenvalues are within +-`shift`.  `vector`
// holds the start vector, and afterwards the eigenvector.
double largest_eigenvalue(Reach& reach, double shift, double sign, double PulledMotor::* vector, int count) {
    const std::int64_t moved = reach.motors.size;
    double length = 0.0;
    for (int turn = 0; turn < count; ++turn) {
        double squares = 0.0;
        for (std::int64_t k = 0; k < moved; ++k) {
            PulledMotor& motor = reach.motors[k];
            motor.force = shift * motor.*vector;
            for (std::int64_t m = 0; m < moved; ++m) motor.force += sign * reach.curvature[k * moved + m] * reach.motors[m].*vector;
            squares += motor.force * motor.force;
        }
        length = std::sqrt(squares);
        for (PulledMotor& motor : reach.motors) motor.*vector = length > 0.0 && motor.mobility > 0.0 ? motor.force / length : 0.0;
    }
    return length - shift;
}

// Add the bend along joints a and b to the curvature matrix, for each pair of motors that drive them.
void add_bend(Reach& reach, std::int64_t a, std::int64_t b, double along) {
    const std::int64_t moved = reach.motors.size;
    const Interval first = reach.joints[a].drives, second = reach.joints[b].drives;
    for (std::int64_t c = first.first; c < first.end; ++c) {
        for (std::int64_t d = second.first; d < second.end; ++d) {
            const ReachDrive &first_drive = reach.drives[c], &second_drive = reach.drives[d];
            const double levers = first_drive.lever * second_drive.lever;
            if (levers == 0.0) continue;
            const double mobilities = reach.motors[first_drive.pulled].mobility * reach.motors[second_drive.pulled].mobility;
            const double value = -along * levers * std::sqrt(mobilities);
            reach.curvature[first_drive.pulled * moved + second_drive.pulled] += value;
            if (a != b) reach.curvature[second_drive.pulled * moved + first_drive.pulled] += value;
        }
    }
}

// Return the largest stiffness [1/s] that the curvature of the marker's path adds to the force, over all directions of motion.
double max_bend(Reach& reach, const Push& push) {
    const std::int64_t moved = reach.motors.size;
    std::fill_n(reach.curvature, moved * moved, 0.0);
    for (std::int64_t a = 0; a < reach.joint_count; ++a)
        for (std::int64_t b = a; b < reach.joint_count; ++b)
            if (reach.joints[a].pulled && reach.joints[b].pulled) add_bend(reach, a, b, joint_bend(reach, push, a, b));
    double squares = 0.0;
    for (std::int64_t k = 0; k < moved; ++k) {
        for (std::int64_t m = 0; m < moved; ++m) squares += reach.curvature[k * moved + m] * reach.curvature[k * moved + m];
        reach.motors[k].bend_direction = 1.0 + 0.1 * static_cast<double>(k);
    }
    return largest_eigenvalue(reach, std::sqrt(squares), 1.0, &PulledMotor::bend_direction, bend_iterations);
}

// Compute the force on the marker that makes its error decay at `rate`.  Double the damping until the curvature of the marker's path
// cannot make it oscillate.
void push_marker(Reach& reach, Push& push, double size, double scale) {
    double damping = relative_damping;
    for (int time = 0; time < max_doublings; ++time) {
        for (int row = 0; row < reach.rows(); ++row) push.force[row] = rate * scale * weight(row) * reach.error[row] / size;
        solve(push, reach.rows(), size, damping);
        if (bend_bound(reach, push) < rate || max_bend(reach, push) < rate) return;
        damping *= 2.0;
    }
}

// Compute the motors' forces: J^T times the force on the marker.
void force_motors(Reach& reach, const Push& push) {
    for (PulledMotor& motor : reach.motors) {
        motor.force = 0.0;
        for (int row = 0; row < reach.rows(); ++row) motor.force += weight(row) * motor.column[row] * push.force[row];
    }
}

// Return the velocity of the motors along the obstructing force; below 0: they move into the obstacle.
double speed_along_obstruction(const Reach& reach) {
    double speed = 0.0;
    for (const PulledMotor& motor : reach.motors) speed += motor.obstruction * motor.mobility * motor.force;
    return speed;
}

// Split the other forces into the limit force of each motor and the rest.  Return whether any of them opposes the motors' forces.
bool is_obstructed(const Law& law, Reach& reach, const double* q, const double* other_forces) {
    bool limited = false;
    for (PulledMotor& motor : reach.motors) {
        const MotorGains& gains = law.motors[motor.motor];
        const double limit = limit_force(gains, q[motor.motor]);
        motor.limit_resistance = limit * motor.force < 0.0 ? std::fabs(limit) / gains.unit : 0.0;
        motor.obstruction = (other_forces[motor.motor] - limit) / gains.unit;
        limited = limited || motor.limit_resistance > 0.0;
    }
    return limited || speed_along_obstruction(reach) < 0.0;
}

// Remove the mobility along `obstruction`, by a share that grows with the size of the obstruction.  Return the share, divided by the
// mobility along it.
double remove_obstructed_mobility(const Reach& reach, Push& push) {
    double squares = 0.0, across = 0.0;
    for (const PulledMotor& motor : reach.motors) {
        squares += motor.obstruction * motor.obstruction;
        across += motor.obstruction * motor.mobility * motor.obstruction;
    }
    if (across == 0.0) return 0.0;
    const double length = std::sqrt(squares);
    const double share = length / (length + wall_force) / across;
    double away[6] = {};
    for (int row = 0; row < reach.rows(); ++row)
        for (const PulledMotor& motor : reach.motors) away[row] += weight(row) * motor.column[row] * motor.mobility * motor.obstruction;
    for (int a = 0; a < reach.rows(); ++a)
        for (int b = 0; b < reach.rows(); ++b) push.mobility[a][b] -= share * away[a] * away[b];
    return share;
}

// Compute the forces again for obstructed motors: along the obstacle, not into it.
void slide(Reach& reach, Push& push, double size, double scale) {
    const double before = speed_along_obstruction(reach);
    for (PulledMotor& motor : reach.motors) motor.mobility *= wall_force / (wall_force + motor.limit_resistance);
    compute_marker_mobility(reach, push);
    const double share = before < 0.0 ? remove_obstructed_mobility(reach, push) : 0.0;
    push_marker(reach, push, size, scale);
    force_motors(reach, push);
    const double speed = speed_along_obstruction(reach);
    for (PulledMotor& motor : reach.motors)
        motor.force = (motor.force - share * speed * motor.obstruction) * wall_force / (wall_force + motor.limit_resistance);
}

void update_reach(Reach& reach, const double* q) {
    place_marker(reach, q);
    update_error(reach);
    compute_descent(reach);
}

// Fill the curvature matrix with the Hessian of half the squared error, scaled by the motors' mobilities.  Return its Frobenius norm.
double compute_curvature(const Law& law, Reach& reach, double* q) {
    const std::int64_t moved = reach.motors.size;
    for (std::int64_t k = 0; k < moved; ++k) {
        const std::int64_t i = reach.motors[k].motor;
        const double here = q[i], probe = probe_size * law.motors[i].unit;
        double* row = reach.curvature + k * moved;
        q[i] = here + probe;
        update_reach(reach, q);
        for (std::int64_t m = 0; m < moved; ++m) row[m] = reach.motors[m].descent;
        q[i] = here + -probe;
        update_reach(reach, q);
        for (std::int64_t m = 0; m < moved; ++m) row[m] = (reach.motors[m].descent - row[m]) / (2.0 * probe_size);
        q[i] = here;
    }
    double squares = 0.0;
    for (std::int64_t k = 0; k < moved; ++k) {
        for (std::int64_t m = 0; m <= k; ++m) {
            double &lower = reach.curvature[k * moved + m], &upper = reach.curvature[m * moved + k];
            const double mean = 0.5 * (lower + upper) * std::sqrt(reach.motors[k].mobility * reach.motors[m].mobility);
            lower = upper = mean;
            squares += k == m ? mean * mean : 2.0 * mean * mean;
        }
    }
    update_reach(reach, q);
    return std::sqrt(squares);
}

// Find a direction out of a singular pose along which the error decreases both forward and backward.  Return false if none exists.
bool find_escape(const Law& law, Reach& reach, double* q, double size) {
    const double shift = compute_curvature(law, reach, q);
    for (std::int64_t k = 0; k < reach.motors.size; ++k) {
        reach.motors[k].last_escape = reach.motors[k].escape;
        reach.motors[k].escape = 1.0 + 0.1 * static_cast<double>(k);
    }
    if (largest_eigenvalue(reach, shift, -1.0, &PulledMotor::escape, escape_iterations) < min_curvature * size) {
        for (PulledMotor& motor : reach.motors) motor.escape = 0.0;
        return false;
    }
    double before = 0.0, middle = 0.0;
    for (const PulledMotor& motor : reach.motors) {
        const MotorGains& gains = law.motors[motor.motor];
        before += motor.escape * motor.last_escape;
        middle += motor.escape * (0.5 * (gains.low + gains.high) - q[motor.motor]);
    }
    if (before < 0.0 || (before == 0.0 && middle < 0.0))
        for (PulledMotor& motor : reach.motors) motor.escape = -motor.escape;
    return true;
}

// Return whether one of the reaches pulls a motor.
bool is_pulled(View<Reach* const> reaches, std::int64_t motor) {
    for (const Reach* reach : reaches)
        for (const PulledMotor& pulled : reach->motors)
            if (pulled.motor == motor) return true;
    return false;
}

}  // namespace pull

void compute_pull(const Law& law, Reach& reach, double* q, double dt, const double* other_forces) {
    const double remaining = pull::smooth_error(reach, dt);
    pull::compute_descent(reach);
    pull::compute_mobility(law, reach, q);
    pull::Push push;
    const double size = pull::compute_marker_mobility(reach, push);
    double squares = 0.0, effective = 0.0;
    for (int row = 0; row < reach.rows(); ++row)
        squares += pull::weight(row) * reach.error[row] * pull::weight(row) * reach.error[row];
    for (const PulledMotor& motor : reach.motors) effective += motor.descent * motor.mobility * motor.descent;
    const bool is_singular = effective < pull::singular_share * pull::singular_share * size * squares;
    const bool needs_escape = is_singular && remaining > pull::tolerance && reach.time_without_progress <= pull::escape_timeout;
    reach.escapes = needs_escape && pull::find_escape(law, reach, q, size);
    const double fade = remaining / (remaining + 0.5 * pull::tolerance);  // at the target the motors do not follow the encoders' noise
    const double scale = fade / (1.0 + std::sqrt(squares) / pull::saturation_length);
    pull::push_marker(reach, push, size, scale);
    pull::force_motors(reach, push);
    if (pull::is_obstructed(law, reach, q, other_forces)) pull::slide(reach, push, size, scale);
}

void replace_springs(const Law& law, const Reach& reach, View<Reach* const> before, const double* q, const double* attractor, double* total) {
    for (const PulledMotor& motor : reach.motors) {
        const std::int64_t i = motor.motor;
        const MotorGains& gains = law.motors[i];
        if (!pull::is_pulled(before, i)) total[i] -= squash(attractor[i] - q[i], gains.max_spring, gains.spring_knee);
        if (reach.escapes) total[i] += squash(pull::escape_step * motor.escape * gains.unit, gains.max_spring, gains.spring_knee);
    }
}

bool has_progress(const Reach& reach) { return reach.smoothed_distance > 0.75 * pull::tolerance && reach.time_without_progress < pull::stall_time; }

}  // namespace mobee
