// SPDX-License-Identifier: Apache-2.0
// Damped least squares from many starts, for what has a derivative: places, directions and distances of points on links.
//
// Levenberg and Marquardt: the damping falls after a step that helped and grows after one that did not; a motor at its limit that would
// be pushed beyond it is left out.  No start knows of another, so threads change nothing.
#include <cmath>
#include <cstring>

#include "aims.hpp"
#include "interface.hpp"
#include "threads.hpp"

namespace mobee {

// What Python asks, see mobee/_core/least_squares.py.
struct Search {
    const Robot* robot;
    const Aim* aims;           // (count,)
    const Goal* goals;         // (count,) for all starts, or (starts, count)
    const std::int64_t* free;  // (motors that may move,)
    const double *low, *high;  // (motors that may move,) rad
    double* q;                 // (starts, motors): moved to where they lead
    double* residuals;         // (starts, count): what every aim misses there, m or rad
    std::int64_t count, frees, starts, one_goal, steps, threads;
};

namespace descent {

constexpr double turn = 0.2;     // m/rad: what an error of direction counts beside one of place
constexpr double longest = 0.3;  // of a motor's range, in one step
constexpr double close = 0.1;    // of every tolerance: there is no need to come nearer
constexpr std::int64_t block = 8;
constexpr double grow = 6.0, fall = 0.25, first_damping = 1e-3, least_damping = 1e-9, most_damping = 1e6;

inline std::int64_t whole_blocks(std::int64_t count) { return (count + block - 1) / block * block; }

inline Four load_four(const double* from) {
    Four value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

// The sum of the products of two rows, whose length is a multiple of `block`, in one order on all processors.
inline double product(const double* a, const double* b, std::int64_t count) {
    Four even{}, odd{};
    for (std::int64_t c = 0; c < count; c += block) {
        even += load_four(a + c) * load_four(b + c);
        odd += load_four(a + c + 4) * load_four(b + c + 4);
    }
    const Four sums = even + odd;
    return (sums[0] + sums[2]) + (sums[1] + sums[3]);
}

// Subtract `factor` times a block from another.
inline void subtract(double* from, double factor, const double* what) {
    const Four low = load_four(from) - factor * load_four(what), high = load_four(from + 4) - factor * load_four(what + 4);
    std::memcpy(from, &low, sizeof low);
    std::memcpy(from + 4, &high, sizeof high);
}

// The links that carry something aimed at, as a robot of their own, and the aims with the numbers that links have there.
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

// One thread's: where it looks, and what it works in.
class Descender {
public:
    void begin(const Search& search, const Carriers& carriers);
    void descend_from(std::int64_t start);
    std::int64_t looks() const { return looks_; }  // how many poses it has looked at

private:
    void descend(const Goal* goals, double* q, double* residuals);
    double look(const Goal* goals, const double* q, Array<double>& errors, double* residuals);
    void find_slopes();
    void find_step(double damping, const double* q);
    void solve(double damping);
    bool hold_at_limits(const double* q);
    bool arrived(const Goal* goals, const double* residuals) const;

    const Search* search_ = nullptr;
    const Robot* robot_ = nullptr;
    const Aim* aims_ = nullptr;
    std::int64_t looks_ = 0;
    std::int64_t rows_ = 0, stride_ = 0;  // of the slopes: the numbers of all aims, and the motors that may move, in whole blocks
    Links links_;
    Array<std::int64_t> column_;   // (motors,): which of those that may move, -1: it stays
    Array<Sight> sights_;          // (aims,)
    Array<double> errors_, tried_errors_;  // (rows,)
    Array<double> slopes_, active_;        // (rows, stride): of all motors, and of those that are not held
    Array<double> matrix_, right_;         // (rows + 1, rows in whole blocks), (rows,)
    Array<double> column_of_matrix_;       // (rows + 1,)
    Array<double> step_;                   // (stride,)
    Array<double> trial_, tried_;          // (motors,), (aims,): a pose, and what the aims miss there
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
    double cost = look(goals, q, errors_, residuals);
    for (std::int64_t step = 0; step < search_->steps && damping <= most_damping && !arrived(goals, residuals); ++step) {
        if (stale) find_slopes();
        find_step(damping, q);
        std::memcpy(trial_.data(), q, pose);
        for (std::int64_t c = 0; c < search_->frees; ++c) {
            double& motor = trial_[search_->free[c]];
            motor = clamp(motor + step_[c], search_->low[c], search_->high[c]);
        }
        const double new_cost = look(goals, trial_.data(), tried_errors_, tried_.data());
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

// Place the links at q; fill the errors (rows,) and the residuals (aims,); returns half the squared sum of the errors.
double Descender::look(const Goal* goals, const double* q, Array<double>& errors, double* residuals) {
    ++looks_;
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

// What the damped system says, without motors that it would push beyond a limit at which they are; no longer than it may be.
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
// Column by column in whole blocks, with the errors as one more row: so no number waits for the sum of others.
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
        column_of_matrix_[j] = 0.0;  // what is left of here is done
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

// Hold the motors that the step pushes beyond a limit at which they are; whether there are any that were not held.
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

// Whether every aim is met, and closer than its tolerance asks.
bool Descender::arrived(const Goal* goals, const double* residuals) const {
    for (std::int64_t k = 0; k < search_->count; ++k)
        if (!(residuals[k] <= close * goals[k].tolerance)) return false;
    return true;
}

}  // namespace descent

// Move the motors that may move of every start to meet the aims; returns how many poses were looked at.
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
    std::int64_t looks = 0;
    for (descent::Descender* one : descenders) {
        looks += one->looks();
        discard(one);
    }
    return looks;
}

}  // namespace mobee
