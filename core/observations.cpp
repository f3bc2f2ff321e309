// SPDX-License-Identifier: Apache-2.0
// What is known of the outcomes of actions, what an observation was worth, and what the next ones may be (thesis 6.4).

#include <cmath>
#include <cstdint>
#include <limits>

#include "array.hpp"
#include "interface.hpp"
#include "transitions.hpp"

namespace mobee {

// The counts of a transition model, where Python keeps them, see mobee/learning/transitions.py.
struct OutcomeCounts {
    double* count;           // (states, actions, bins): T(s, a), imagined observations included, 0 where there is no bin
    double* probability;     // (states, actions, bins)
    std::int64_t* outcome;   // (states, actions, bins)
    std::int64_t* used;      // (states, actions): how many bins there are, the first of them for staying and for the goal
    double* weight;          // (states, actions): the sum of the real counts
    double* total;           // (states, actions): of the counts that the reward is taken over
    double* reward;          // (states, actions): the last information gain, in nats
    std::int64_t* tries;     // (states, actions)
    const double* imagined;  // (bins,): how much of a bin's count is imagined
    std::int64_t actions, bins;
    std::int64_t over_states;  // the reward is taken over so many states, each imagined once; 0: over the bins of the state-action
    double forgetting;         // factor of the real counts before an observation
};

// Probabilities from the real counts alone over a weak prior, see mobee/learning/transitions.py.
struct DebiasedCounts {
    double* probability;  // (states, actions, bins)
    const double* prior;  // (bins,)
    double sum;           // of the prior
};

namespace observing {

constexpr double new_bin = 1.0;      // the imagined count of all bins but the first two (Algorithm 6)
constexpr double no_room = -1.0;     // instead of a reward: all bins are in use
constexpr double infinity = std::numeric_limits<double>::infinity();

// KL(P || T) in nats when one bin of T grows by one (eq. 6.5): its count before, and that of all bins.
inline double information_gain(double count, double total) {
    const double gain = (count + 1.0) / (total + 1.0) * std::log1p(1.0 / count) - std::log1p(1.0 / total);
    return gain > 0.0 ? gain : 0.0;  // rounding
}

// How many bins a state-action has; not more than fit, should another thread of Python have made room meanwhile.
inline std::int64_t bins_of(const OutcomeCounts& known, std::int64_t row) { return known.used[row] < known.bins ? known.used[row] : known.bins; }

// The bin of an outcome, the next free one if it is new.
std::int64_t bin_of(const OutcomeCounts& known, std::int64_t row, std::int64_t outcome) {
    const std::int64_t* outcomes = known.outcome + row * known.bins;
    const std::int64_t used = bins_of(known, row);
    std::int64_t bin = 0;
    while (bin < used && outcomes[bin] != outcome) ++bin;
    return bin;
}

inline double imagined_total(const OutcomeCounts& known, std::int64_t used) {
    return known.imagined[0] + known.imagined[1] + static_cast<double>(used - 2) * new_bin;
}

// What an observation of a bin would pay now.
double gain(const OutcomeCounts& known, std::int64_t row, std::int64_t bin) {
    const std::int64_t used = bins_of(known, row);
    const double weight = known.weight[row] * known.forgetting;
    const double imagined = bin < used ? known.imagined[bin] : new_bin;
    const double real = bin < used ? (known.count[row * known.bins + bin] - imagined) * known.forgetting : 0.0;
    if (known.over_states > 0) return information_gain(1.0 + real, static_cast<double>(known.over_states) + weight);
    return information_gain(imagined + real, imagined_total(known, bin < used ? used : bin + 1) + weight);
}

// Count one real transition (Algorithm 6) and return its reward.
double observe(const OutcomeCounts& known, std::int64_t row, std::int64_t outcome) {
    const std::int64_t bin = bin_of(known, row, outcome);
    if (bin == known.bins) return no_room;
    const double reward = gain(known, row, bin);
    double* count = known.count + row * known.bins;
    std::int64_t used = bins_of(known, row);
    if (known.forgetting < 1.0)
        for (std::int64_t b = 0; b < used; ++b) count[b] = (count[b] - known.imagined[b]) * known.forgetting + known.imagined[b];
    if (bin == used) {
        count[bin] = new_bin;
        known.outcome[row * known.bins + bin] = outcome;
        known.used[row] = ++used;
    }
    count[bin] += 1.0;
    const double weight = known.weight[row] * known.forgetting + 1.0;
    const double total = weight + imagined_total(known, used);
    for (std::int64_t b = 0; b < used; ++b) known.probability[row * known.bins + b] = count[b] / total;
    known.weight[row] = weight;
    known.total[row] = known.over_states > 0 ? weight + static_cast<double>(known.over_states) : total;
    known.reward[row] = reward;
    ++known.tries[row];
    return reward;
}

void believe(const OutcomeCounts& known, const DebiasedCounts& beliefs, std::int64_t row) {
    for (std::int64_t b = 0; b < bins_of(known, row); ++b) {
        const double real = known.count[row * known.bins + b] - known.imagined[b];
        beliefs.probability[row * known.bins + b] = (real + beliefs.prior[b]) / (known.weight[row] + beliefs.sum);
    }
}

// Counts over which the gain of the next observation will be taken.
struct NextCounts {
    const double* count;  // (states, actions, bins), above 0 where the probability is
    const double* total;  // (states, actions)
};

// The information gain to expect, in nats, after `more` observations of the bin `likely`.
double expected(const TransitionTable& table, const NextCounts& next, std::int64_t row, std::int64_t likely, double more) {
    const double* probability = table.probability + row * table.bins;
    const double total = next.total[row];
    double gain = 0.0;
    for (std::int64_t b = 0; b < table.bins; ++b) {
        if (!(probability[b] > 0.0)) continue;
        double count = next.count[row * table.bins + b];
        if (b == likely) count += more;
        gain += probability[b] * (count + 1.0) / (total + more + 1.0) * std::log1p(1.0 / count);
    }
    gain -= std::log1p(1.0 / (total + more));
    return gain > 0.0 ? gain : 0.0;
}

std::int64_t largest(const double* values, std::int64_t count) {
    std::int64_t at = 0;
    for (std::int64_t k = 1; k < count; ++k)
        if (values[k] > values[at]) at = k;
    return at;
}

}  // namespace observing

// What observing an outcome would pay now; changes nothing.
MOBEE_CALL double mobee_gain(const OutcomeCounts* known, std::int64_t state, std::int64_t action, std::int64_t outcome) {
    const std::int64_t row = state * known->actions + action;
    return observing::gain(*known, row, observing::bin_of(*known, row, outcome));
}

// Count one real transition; returns its reward, or `no_room` if there has to be one more bin first.
MOBEE_CALL double mobee_observe(const OutcomeCounts* known, std::int64_t state, std::int64_t action, std::int64_t outcome) {
    return observing::observe(*known, state * known->actions + action, outcome);
}

// Let beliefs follow the counts of a state-action.
MOBEE_CALL void mobee_believe(const OutcomeCounts* known, const DebiasedCounts* beliefs, std::int64_t state, std::int64_t action) {
    observing::believe(*known, *beliefs, state * known->actions + action);
}

// Replace the `gains` (states, actions) of all that was tried by the information gain to expect next.
MOBEE_CALL void mobee_expected_gains(const TransitionTable* table, const observing::NextCounts* next, const std::int64_t* tries, double* gains) {
    for (std::int64_t row = 0; row < table->states * table->actions; ++row)
        if (tries[row] != 0) gains[row] = observing::expected(*table, *next, row, 0, 0.0);
}

// Follow the best actions from a state through their most likely outcomes, and let the `gains` (states, actions) met fall as they would.
// `action_values` (states, actions) are minus infinity where there is no action.
MOBEE_CALL void mobee_deplete(const TransitionTable* table, const observing::NextCounts* next, const double* action_values,
                              std::int64_t state, std::int64_t steps, double* gains) {
    const std::int64_t actions = table->actions;
    Array<double> met(table->states * actions);
    for (std::int64_t step = 0; step < steps; ++step) {
        const std::int64_t row = state * actions + observing::largest(action_values + state * actions, actions);
        if (action_values[row] == -observing::infinity) return;
        const std::int64_t likely = observing::largest(table->probability + row * table->bins, table->bins);
        met[row] += 1.0;
        const double left = observing::expected(*table, *next, row, likely, met[row]);
        gains[row] = left < gains[row] ? left : gains[row];
        state = table->outcome[row * table->bins + likely];
    }
}

}  // namespace mobee
