// SPDX-License-Identifier: Apache-2.0
// The values of states and actions (thesis Algorithm 7), and modified policy iteration.
//
// Sums have a fixed order, so that actions with equal data have values with equal bits: ties stay ties.

#include <cmath>
#include <cstring>
#include <limits>

#include "array.hpp"
#include "interface.hpp"
#include "transitions.hpp"
#include "vector.hpp"

namespace mobee::planning {

enum Refused : std::int64_t { bad_reward = -1, bad_outcome = -2, bad_start = -3 };  // instead of the number of sweeps

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr double rounding = 4.0 * 0x1p-52;      // relative to a value: changes as small as this may cycle indefinitely
constexpr double soon = 50.0;                   // divided by 1 - discount: number of sweeps after which a change has decreased by the factor e^-50
constexpr std::int64_t most_evaluated = 60;     // improvements that are followed by an evaluation; later ones are plain sweeps, which converge from anywhere
constexpr std::int64_t most_evaluations = 5;    // sweeps of one evaluation at most
constexpr double alike = 0.5;                   // changes whose spread is less than this share of the largest

struct Wanted {
    double discount, tolerance;
    bool relative;  // the tolerance is in units of the largest reward of an action
    bool evaluate;  // modified policy iteration
};

struct Branch {
    double weight;  // the discounted probability
    std::int64_t to;
};

struct Problem {
    const TransitionTable& table;
    const double* reward;  // (states, actions)
    double discount;
    Array<std::int64_t> chosen;  // (states,): the best row s A + a of each state, -1 without any
    Array<double> fresh;         // (states,): values that are not valid yet
    Array<std::int64_t> end;     // (rows + 1,): the branches of a row are end[row] to end[row + 1], none if it is no action
    Array<Branch> branch;        // outcomes with a probability above 0, row by row
};

struct Sweep {
    double change = 0.0;   // the largest: of action values, or with evaluations of state values
    double largest = 0.0;  // value
};

// The best action of a state so far.
struct Best {
    double value = -infinity;
    std::int64_t row = -1;
};

inline std::int64_t bins_of(const TransitionTable& table, std::int64_t row) {
    return table.used != nullptr && table.used[row] < table.bins ? table.used[row] : table.bins;
}

inline void take(const Best& best, std::int64_t state, bool of_states, const double* values, Problem& problem, Sweep& sweep) {
    problem.chosen[state] = best.row;
    if (best.row < 0) return;
    problem.fresh[state] = best.value;
    const double by = std::fabs(best.value - values[state]);
    sweep.largest = most(std::fabs(best.value), sweep.largest);
    if (of_states) sweep.change = most(by, sweep.change);
}

// The first sweep: reads and checks the tables, and keeps the bins that are not empty.  Returns 0 or an error code.
std::int64_t begin(Problem& problem, bool of_states, double* values, double* found, Sweep& sweep, double& largest_reward) {
    const TransitionTable& table = problem.table;
    const std::int64_t states = table.states, actions = table.actions, bins = table.bins;
    problem.end.reserve(states * actions + 1);
    problem.branch.reserve(states * actions * bins);
    std::int64_t* end = problem.end.data();
    Branch* branch = problem.branch.data();
    std::int64_t used = end[0] = 0;
    for (std::int64_t s = 0; s < states; ++s) {
        Best best;
        for (std::int64_t row = s * actions; row < (s + 1) * actions; ++row) {
            const double *probability = table.probability + row * bins, reward = problem.reward[row];
            const std::int64_t *outcome = table.outcome + row * bins, there = reward == -infinity ? 0 : bins_of(table, row);
            double value = 0.0;
            for (std::int64_t b = 0; b < there; ++b) {
                if (probability[b] == 0.0) continue;
                const std::int64_t to = outcome[b];
                if (to < 0 || to >= states) return bad_outcome;
                branch[used] = {problem.discount * probability[b], to};
                value += branch[used++].weight * values[to];
            }
            end[row + 1] = used;
            found[row] = used > end[row] ? value + reward : -infinity;
            if (used == end[row]) continue;
            if (!std::isfinite(reward)) return bad_reward;
            largest_reward = most(std::fabs(reward), largest_reward);
            if (!of_states) sweep.change = most(std::fabs(found[row] - values[s]), sweep.change);
            if (found[row] > best.value) best = {found[row], row};
        }
        take(best, s, of_states, values, problem, sweep);
    }
    return 0;
}

inline double onward(const Problem& problem, std::int64_t row, const double* values) {
    double value = 0.0;
    for (std::int64_t k = problem.end[row]; k < problem.end[row + 1]; ++k)
        value += problem.branch[k].weight * values[problem.branch[k].to];
    return value + problem.reward[row];
}

// One more sweep over all actions: all action values from the old state values.
Sweep improve(Problem& problem, bool of_states, const double* values, double* found) {
    const std::int64_t actions = problem.table.actions;
    Sweep sweep;
    for (std::int64_t s = 0; s < problem.table.states; ++s) {
        Best best;
        for (std::int64_t row = s * actions; row < (s + 1) * actions; ++row) {
            if (problem.end[row + 1] == problem.end[row]) continue;
            const double value = onward(problem, row, values);
            if (!of_states) sweep.change = most(std::fabs(value - found[row]), sweep.change);
            found[row] = value;
            if (value > best.value) best = {value, row};
        }
        take(best, s, of_states, values, problem, sweep);
    }
    return sweep;
}

// A few sweeps over the chosen row of each state, all from the old values, so that states with equal data keep equal values.  If all values
// change by nearly the same amount, they would change further by discount / (1 - discount) times as much: that step is made at once.
void evaluate(Problem& problem, double tolerance, double* values) {
    const std::int64_t states = problem.table.states;
    for (std::int64_t sweep = 0; sweep < most_evaluations; ++sweep) {
        double smallest = infinity, highest = -infinity;
        for (std::int64_t s = 0; s < states; ++s) {
            if (problem.chosen[s] < 0) continue;
            const double value = onward(problem, problem.chosen[s], values), by = value - values[s];
            smallest = by < smallest ? by : smallest;
            highest = by > highest ? by : highest;
            problem.fresh[s] = value;
        }
        double change = std::fabs(highest) > std::fabs(smallest) ? std::fabs(highest) : std::fabs(smallest), ahead = 0.0;
        if (highest - smallest < alike * change) {
            change = highest - smallest;
            ahead = 0.5 * (smallest + highest) * problem.discount / (1.0 - problem.discount);
        }
        for (std::int64_t s = 0; s < states; ++s)
            if (problem.chosen[s] >= 0) values[s] = problem.fresh[s] + ahead;
        if (change < tolerance) return;
    }
}

// Sweep over all actions until nothing changes by the tolerance; with `evaluate` each sweep is followed by some over the best action of
// each state alone.  `values` (states,) change in place, `found` (states, actions) is filled.  An entry without probability, or with reward
// minus infinity, is no action: its value is minus infinity.  Returns the number of sweeps over all actions, or an error code.
std::int64_t solve(const TransitionTable& table, const double* reward, const Wanted& wanted, double* values, double* found) {
    for (std::int64_t s = 0; s < table.states; ++s)
        if (!std::isfinite(values[s])) return bad_start;
    Problem problem{table, reward, wanted.discount, Array<std::int64_t>(table.states), Array<double>(values, table.states), {}, {}};
    Sweep done;
    double largest_reward = 0.0;
    if (const std::int64_t wrong = begin(problem, wanted.evaluate, values, found, done, largest_reward)) return wrong;
    const double limit = wanted.relative && largest_reward > 0.0 ? wanted.tolerance * largest_reward : wanted.tolerance;
    for (std::int64_t sweeps = 1;; ++sweeps) {
        std::memcpy(values, problem.fresh.data(), table.states * sizeof(double));
        // A change that is larger than the discount allows by now is rounding too: a cycle of more than four last bits.
        const double patience = 1.0 + std::floor(static_cast<double>(sweeps) * (1.0 - wanted.discount) / soon);
        if (done.change < limit || done.change <= patience * rounding * done.largest) return sweeps;
        if (wanted.evaluate && sweeps <= most_evaluated) evaluate(problem, 0.5 * (1.0 - wanted.discount) * limit, values);
        done = improve(problem, wanted.evaluate, values, found);
    }
}

}  // namespace mobee::planning

MOBEE_CALL std::int64_t mobee_value_iteration(const mobee::TransitionTable* table, const double* reward, double* values, double* found,
                                              double discount, double tolerance, std::int64_t relative, std::int64_t evaluate) {
    return mobee::planning::solve(*table, reward, {discount, tolerance, relative != 0, evaluate != 0}, values, found);
}
