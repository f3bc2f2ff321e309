// SPDX-License-Identifier: Apache-2.0
// Finds the pairs of volumes that may touch in a pose, in three steps: balls about clusters, balls about volumes, and the sieve.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "scene.hpp"

namespace mobee {

// A slot of the robot, and another or, from the number of slots on, a free object.
struct Pair {
    std::int32_t first = 0, second = 0;
};

// A list of pairs: the first and the second volume of each.
struct PairList {
    Array<std::int32_t> first, second;

    std::size_t size() const { return first.size(); }
    void clear();
};

// The free objects near one cluster, as columns.
struct Near {
    Array<float> x, y, z, bound;
    Array<std::int32_t> second;  // the index of each as the second volume of a pair
    std::int64_t count = 0;
};

// The pairs of one pose, and the buffers of the search, which are kept because allocating memory takes longer than the search.
struct Pairs {
    PairList thick;       // two volumes about their cores, see `Outline`
    PairList others;      // a box or a hull with any volume
    Array<Pair> left;     // the pairs that the sieve does not drop
    PairList with_world;  // pairs with an object, before they are sorted into `thick` and `others`
    Near near;
};

// Find the pairs whose balls are nearer than the skin [m].
void find_pairs(const Scene& scene, const Placed& placed, double skin, Pairs& pairs);

// Keep the pairs of volumes that may be nearer than the skin; for most pairs of near balls the volumes are far apart.
void sieve(const Scene& scene, Placed& placed, double skin, Pairs& pairs);

}  // namespace mobee
