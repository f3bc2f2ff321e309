// SPDX-License-Identifier: Apache-2.0
// Damped least squares from many starts, for aims with a derivative: positions, directions and distances of points on links.
//
// Levenberg and Marquardt: the damping falls after a step that helped and grows after one that did not; a motor at its limit that would
// be pushed beyond it is left out.  The starts are independent, so the number of threads changes nothing.
#include <cmath>
#include <cstring>

#include "aims.hpp"
#include "interface.hpp"
#include "threads.hpp"

namespace mobee {

// The arguments from Python, see mobee/_core/roadmap.py.
struct Search {
    const Robot* robot;
    const Aim* aims;           // (count,)
    const Goal* goals;         // (count,) for all starts, or (starts, count)
    const std::int64_t* free;  // (motors that may move,)
    const double *low, *high;  // (motors that may move,) rad
    double* q;                 // (starts, motors): replaced by the solutions
    double* residuals;         // (starts, count): error of every aim at the solution, m or rad
    std::int64_t count, frees, starts, one_goal, steps, threads;
};

namespace descent {

constexpr double turn = 0.2;     // m/rad: weight of an error of direction relative to one of position
constexpr double longest = 0.3;  // of a motor's range: longest step
constexpr double close = 0.1;    // share of every tolerance at which an aim is near enough
constexpr std::int64_t block = 8;
constexpr double grow = 6.0, fall = 0.25, first_damping = 1e-3, least_damping = 1e-9, most_damping = 1e6;

inline std::int64_t whole_blocks(std::int64_t count) { return (count + block - 1) / block * block; }

inline Four load_four(const double* from) {
    Four value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

// Return the dot product of two rows, whose length is a multiple of `block`, summed in one order on all processors.
inline double product(const double* a, const double* b, std::int64_t count) {
    Four even{}, odd{};
    for (std::int64_t c = 0; c < count; c += block) {
        even += load_four(a + c) * load_four(b + c);
        odd += load_four(a + c + 4) * load_four(b + c + 4);
    }
    const Four sums = even + odd;
    return (sums[0] + sums[2]) + (sums[1] + sums[3]);
}

// Subtract `factor` times one block from another.
inline void subtract(double* from, double factor, const double* what) {
    const Four low = load_four(from) - factor * load_four(what), high = load_four(from + 4) - factor * load_four(what + 4);
    std::memcpy(from, &low, sizeof low);
    std::memcpy(from + 4, &high, sizeof high);
}

// A robot reduced to the links that aims depend on, and the aims with the indices of these links.
struct Carriers {
    Robot robot;
    Array<Aim> aims;  // (count,)

    explicit Carriers(const Search& search);
};

Carriers::Carriers(const Search& search) : aims(search.aims, search.count) {
    const Robot& whole = *search.robot;
    Array<std::int64_t> number(whole.links);
    for (const Aim& aim : aims)
        for (std::int64_t end : {aim.first, aim.second})
            for (std::int64_t link = end; link > 0; link = whole.joint[link - 1].parent) number[link] = 1;
    for (std::int64_t link = 1; link < whole.links; ++link) {
        if (number[link] == 0) continue;
        robot.joint.push(whole.joint[link - 1]);
        robot.offset.push(whole.offset[link - 1]);
        Joint& joint = robot.joint[robot.joints++];
        joint.parent = number[joint.parent];
        number[link] = robot.joints;
    }
    robot.motors = whole.motors;
    robot.links = robot.joints + 1;
    robot.drives = whole.drives;
    robot.motor.resize(robot.drives * robot.joints);
    robot.scale.resize(robot.drives * robot.joints);
    for (std::int64_t drive = 0; drive < robot.drives; ++drive) {
        for (std::int64_t link = 1; link < whole.links; ++link) {
            if (number[link] == 0) continue;
            const std::int64_t from = drive * whole.joints + link - 1, to = drive * robot.joints + number[link] - 1;
            robot.motor[to] = whole.motor[from];
            robot.scale[to] = whole.scale[from];
        }
    }
    for (Aim& aim : aims) {
        aim.first = number[aim.first];
        aim.second = number[aim.second];
    }
}

// The work of one thread: its position in the search, and its buffers.
class Descender {
public:
    void begin(const Search& search, const Carriers& carriers);
    void descend_from(std::int64_t start);
    std::int64_t evaluations() const { return evaluations_; }  // number of poses

private:
    void descend(const Goal* goals, double* q, double* residuals);
    double evaluate(const Goal* goals, const double* q, Array<double>& errors, double* residuals);
    void find_slopes();
    void find_step(double damping, const double* q);
    void solve(double damping);
    bool hold_at_limits(const double* q);
    bool arrived(const Goal* goals, const double* residuals) const;

    const Search* search_ = nullptr;
    const Robot* robot_ = nullptr;
    const Aim* aims_ = nullptr;
    std::int64_t evaluations_ = 0;
    std::int64_t rows_ = 0, stride_ = 0;  // of the slopes: number of rows of all aims; number of motors that may move, rounded up to whole blocks
    Links links_;
    Array<std::int64_t> column_;   // (motors,): index among the motors that may move; -1: the motor does not move
    Array<Sight> sights_;          // (aims,)
    Array<double> errors_, tried_errors_;  // (rows,)
    Array<double> slopes_, active_;        // (rows, stride): of all motors; of the motors that are not held
    Array<double> matrix_, right_;         // (rows + 1, rows in whole blocks), (rows,)
    Array<double> column_of_matrix_;       // (rows + 1,)
    Array<double> step_;                   // (stride,)
    Array<double> trial_, tried_;          // (motors,), (aims,): a pose, and the errors of the aims there
    Array<bool> held_;                     // (motors that may move,): at a limit
};

void Descender::begin(const Search& search, const Carriers& carriers) {
    const Robot& robot = carriers.robot;
    search_ = &search;
    robot_ = &robot;
    aims_ = carriers.aims.data();
    for (const Aim& aim : carriers.aims) rows_ += rows_of(aim.kind);
    stride_ = whole_blocks(search.frees);
    links_.fit(robot);
    column_.resize(robot.motors);
    for (std::int64_t& column : column_) column = -1;
    for (std::int64_t c = 0; c < search.frees; ++c) column_[search.free[c]] = c;
    sights_.resize(search.count);
    for (Array<double>* of_rows : {&errors_, &tried_errors_, &right_}) of_rows->resize(whole_blocks(rows_));
    slopes_.resize(rows_ * stride_);
    active_.resize(rows_ * stride_);
    matrix_.resize((rows_ + 1) * whole_blocks(rows_));
    column_of_matrix_.resize(whole_blocks(rows_ + 1));
    step_.resize(stride_);
    trial_.resize(robot.motors);
    tried_.resize(search.count);
    held_.resize(search.frees);
}

void Descender::descend_from(std::int64_t start) {
    const Goal* goals = search_->goals + (search_->one_goal != 0 ? 0 : start * search_->count);
    descend(goals, search_->q + start * robot_->motors, search_->residuals + start * search_->count);
}

// Move one start q (motors,).
void Descender::descend(const Goal* goals, double* q, double* residuals) {
    const std::size_t pose = trial_.size() * sizeof(double);
    double damping = first_damping;
    bool stale = true;
    double cost = evaluate(goals, q, errors_, residuals);
    for (std::int64_t step = 0; step < search_->steps && damping <= most_damping && !arrived(goals, residuals); ++step) {
        if (stale) find_slopes();
        find_step(damping, q);
        std::memcpy(trial_.data(), q, pose);
        for (std::int64_t c = 0; c < search_->frees; ++c) {
            double& motor = trial_[search_->free[c]];
            motor = clamp(motor + step_[c], search_->low[c], search_->high[c]);
        }
        const double new_cost = evaluate(goals, trial_.data(), tried_errors_, tried_.data());
        stale = new_cost < cost;
        if (!stale) {
            damping *= grow;
            continue;
        }
        const bool slow = new_cost > (1.0 - 1e-6) * cost;
        damping = most(damping * fall, least_damping);
        cost = new_cost;
        std::memcpy(q, trial_.data(), pose);
        std::memcpy(errors_.data(), tried_errors_.data(), rows_ * sizeof(double));
        std::memcpy(residuals, tried_.data(), tried_.size() * sizeof(double));
        if (slow) break;
    }
}

// Place the links at q, and fill the errors (rows,) and the residuals (aims,); returns half the sum of the squared errors.
double Descender::evaluate(const Goal* goals, const double* q, Array<double>& errors, double* residuals) {
    ++evaluations_;
    place_links_at(*robot_, q, links_);
    double total = 0.0;
    std::int64_t row = 0;
    for (std::int64_t k = 0; k < search_->count; ++k) {
        const AimKind kind = aims_[k].kind;
        residuals[k] = see(aims_[k], goals[k], q, links_.frame.data(), sights_[k]);
        const Vec3 error = (is_turn(kind) ? turn : 1.0) * sights_[k].missing;
        for (int r = 0; r < rows_of(kind); ++r) {
            errors[row++] = error[r];
            total += 0.5 * error[r] * error[r];
        }
    }
    return total;
}

void Descender::find_slopes() {
    std::memset(slopes_.data(), 0, slopes_.size() * sizeof(double));
    const Slopes slopes{column_.data(), turn, stride_, slopes_.data()};
    std::int64_t row = 0;
    for (std::int64_t k = 0; k < search_->count; ++k) {
        add_slopes(*robot_, aims_[k], sights_[k], links_.frame.data(), row, slopes);
        row += rows_of(aims_[k].kind);
    }
}

// Compute the step of the damped system, bounded in length, without motors at a limit that it would push beyond it.
void Descender::find_step(double damping, const double* q) {
    std::memset(held_.data(), 0, held_.size() * sizeof(bool));
    std::memcpy(active_.data(), slopes_.data(), slopes_.size() * sizeof(double));
    for (int round = 0; round < 4; ++round) {
        solve(damping);
        std::memset(step_.data(), 0, step_.size() * sizeof(double));
        for (std::int64_t i = 0; i < rows_; ++i)
            for (std::int64_t c = 0; c < stride_; ++c) step_[c] += active_[i * stride_ + c] * right_[i];
        if (!hold_at_limits(q)) break;
    }
    double largest = 0.0;
    for (std::int64_t c = 0; c < search_->frees; ++c) largest = most(std::fabs(step_[c]) / (search_->high[c] - search_->low[c]), largest);
    if (largest > longest)
        for (std::int64_t c = 0; c < search_->frees; ++c) step_[c] *= longest / largest;
}

// Fill `right` with the solution of (A A^T + damping) x = errors, A the active slopes, by Cholesky's method: the matrix is L L^T.
// Column by column in whole blocks, with the errors as one more row, so that no number depends on a sum that is not finished.
void Descender::solve(double damping) {
    const std::int64_t side = whole_blocks(rows_);
    double* m = matrix_.data();
    std::memset(m, 0, rows_ * side * sizeof(double));
    for (std::int64_t i = 0; i < rows_; ++i) {
        for (std::int64_t j = 0; j <= i; ++j) m[i * side + j] = product(&active_[i * stride_], &active_[j * stride_], stride_);
        m[i * side + i] += damping;
    }
    std::memcpy(m + rows_ * side, errors_.data(), side * sizeof(double));
    for (std::int64_t j = 0; j < rows_; ++j) {
        const double pivot = std::sqrt(most(m[j * side + j], 1e-300));
        for (std::int64_t i = j; i <= rows_; ++i) column_of_matrix_[i] = m[i * side + j] /= pivot;
        column_of_matrix_[j] = 0.0;  // the columns to the left are finished
        for (std::int64_t i = j + 1; i <= rows_; ++i) {
            double* row = m + i * side;
            const double factor = row[j];
            for (std::int64_t k = j / block * block; k < side && k <= i; k += block) subtract(row + k, factor, &column_of_matrix_[k]);
        }
    }
    std::memcpy(right_.data(), m + rows_ * side, side * sizeof(double));
    for (std::int64_t i = rows_ - 1; i >= 0; --i) {
        const double* row = m + i * side;
        right_[i] /= row[i];
        for (std::int64_t k = 0; k < i; ++k) right_[k] -= row[k] * right_[i];
    }
}

// Hold the motors at a limit that the step would push beyond it; returns whether there are new ones.
bool Descender::hold_at_limits(const double* q) {
    bool any = false;
    for (std::int64_t c = 0; c < search_->frees; ++c) {
        const double here = q[search_->free[c]];
        const bool out = (here <= search_->low[c] && step_[c] < 0.0) || (here >= search_->high[c] && step_[c] > 0.0);
        if (held_[c] || !out) continue;
        held_[c] = any = true;
        for (std::int64_t i = 0; i < rows_; ++i) active_[i * stride_ + c] = 0.0;
    }
    return any;
}

// Return whether every aim is met, well within its tolerance.
bool Descender::arrived(const Goal* goals, const double* residuals) const {
    for (std::int64_t k = 0; k < search_->count; ++k)
        if (!(residuals[k] <= close * goals[k].tolerance)) return false;
    return true;
}

}  // namespace descent

// Move the free motors of every start towards the aims; returns the number of evaluated poses.
MOBEE_CALL std::int64_t mobee_descend(const Search* search) {
    const std::int64_t most_threads = search->starts > 1 ? search->starts : 1;
    const std::int64_t threads = search->threads < most_threads ? search->threads : most_threads;
    const descent::Carriers carriers(*search);
    Array<descent::Descender*> descenders;
    for (std::int64_t k = 0; k < threads; ++k) {
        descenders.push(make<descent::Descender>());
        descenders[k]->begin(*search, carriers);
    }
    share(search->starts, 1, threads, [&](std::int64_t thread, std::int64_t start, std::int64_t) { descenders[thread]->descend_from(start); });
    std::int64_t evaluations = 0;
    for (descent::Descender* one : descenders) {
        evaluations += one->evaluations();
        discard(one);
    }
    return evaluations;
}

}  // namespace mobee
