// SPDX-License-Identifier: Apache-2.0
// The outcomes of actions: tables over states, actions and bins, one bin for each outcome of a state-action.
#pragma once

#include <cstdint>

namespace mobee {

struct TransitionTable {
    const double* probability;    // (states, actions, bins), all 0 where a state has no such action
    const std::int64_t* outcome;  // (states, actions, bins): the state reached, meaningless where the probability is 0
    const std::int64_t* used;     // (states, actions): number of bins in use; nullptr: all are
    std::int64_t states, actions, bins;
};

}  // namespace mobee
