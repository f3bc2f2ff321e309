// SPDX-License-Identifier: Apache-2.0
// Counts of the outcomes of actions, the reward of an observation, and the expected rewards of the next ones (thesis 6.4).

#include <cmath>
#include <cstdint>
#include <limits>

#include "array.hpp"
#include "interface.hpp"
#include "transitions.hpp"

namespace mobee {

// The counts of a transition model, in Python's arrays, see mobee/learning/transitions.py.
struct OutcomeCounts {
    double* count;           // (states, actions, bins): T(s, a), imagined observations included, 0 where there is no bin
    double* probability;     // (states, actions, bins)
    std::int64_t* outcome;   // (states, actions, bins)
    std::int64_t* used;      // (states, actions): number of bins in use; the first two are for staying and for the goal
    double* weight;          // (states, actions): the sum of the real counts
    double* total;           // (states, actions): sum of the counts from which the reward is computed
    double* reward;          // (states, actions): the last information gain, in nats
    std::int64_t* tries;     // (states, actions)
    const double* imagined;  // (bins,): imagined part of a bin's count
    std::int64_t actions, bins;
    std::int64_t over_states;  // number of states, each imagined once, over which the reward is computed; 0: over the bins of the state-action
    double forgetting;         // factor of the real counts before an observation
};

// Probabilities from the real counts alone over a weak prior, see mobee/learning/transitions.py.
struct DebiasedCounts {
    double* probability;  // (states, actions, bins)
    const double* prior;  // (bins,)
    double sum;           // sum of the prior
};

namespace observing {

constexpr double new_bin = 1.0;      // the imagined count of every bin after the first two (Algorithm 6)
constexpr double no_room = -1.0;     // returned instead of a reward if all bins are in use
constexpr double infinity = std::numeric_limits<double>::infinity();

// Return KL(P || T) in nats for an observation that adds 1 to one bin (eq. 6.5), from its count and the total before.
inline double information_gain(double count, double total) {
    const double gain = (count + 1.0) / (total + 1.0) * std::log1p(1.0 / count) - std::log1p(1.0 / total);
    return gain > 0.0 ? gain : 0.0;  // rounding
}

// Return the number of bins of a state-action, at most the number in the arrays, since another Python thread may have widened them.
inline std::int64_t bins_of(const OutcomeCounts& known, std::int64_t row) { return known.used[row] < known.bins ? known.used[row] : known.bins; }

// Return the bin of an outcome; for a new outcome, the next free bin.
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

// Return the reward that an observation of a bin would have now.
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

// Counts from which the gain of the next observation is computed.
struct NextCounts {
    const double* count;  // (states, actions, bins): above 0 where the probability is above 0
    const double* total;  // (states, actions)
};

// Return the expected information gain [nats] of the next observation, after `more` observations of the bin `likely`.
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

// Return the reward that observing an outcome would have now; changes nothing.
MOBEE_CALL double mobee_gain(const OutcomeCounts* known, std::int64_t state, std::int64_t action, std::int64_t outcome) {
    const std::int64_t row = state * known->actions + action;
    return observing::gain(*known, row, observing::bin_of(*known, row, outcome));
}

// Count one real transition; returns its reward, or `no_room` if the arrays need one more bin.
MOBEE_CALL double mobee_observe(const OutcomeCounts* known, std::int64_t state, std::int64_t action, std::int64_t outcome) {
    return observing::observe(*known, state * known->actions + action, outcome);
}

// Compute the debiased probabilities of a state-action anew from its counts.
MOBEE_CALL void mobee_believe(const OutcomeCounts* known, const DebiasedCounts* beliefs, std::int64_t state, std::int64_t action) {
    observing::believe(*known, *beliefs, state * known->actions + action);
}

// Replace the `gains` (states, actions) of all tried state-actions by the expected information gain of their next try.
MOBEE_CALL void mobee_expected_gains(const TransitionTable* table, const observing::NextCounts* next, const std::int64_t* tries, double* gains) {
    for (std::int64_t row = 0; row < table->states * table->actions; ++row)
        if (tries[row] != 0) gains[row] = observing::expected(*table, *next, row, 0, 0.0);
}

// Simulate the best actions from a state, each with its most likely outcome, and reduce the `gains` (states, actions) of these actions as
// the observations would.  `action_values` (states, actions) are minus infinity where there is no action.
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
