// SPDX-License-Identifier: Apache-2.0
// Which pairs of volumes may touch in a pose, found in three steps: balls about clusters, balls about volumes, and the sieve.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "scene.hpp"

namespace mobee {

// A slot of the robot, and another or, from the number of slots on, a free object.
struct Pair {
    std::int32_t first = 0, second = 0;
};

// Pairs that are being listed: for each the first and the second.
struct PairList {
    Array<std::int32_t> first, second;

    std::size_t size() const { return first.size(); }
    void clear();
};

// The free objects near one cluster, as columns.
struct Near {
    Array<float> x, y, z, bound;
    Array<std::int32_t> second;  // each of them as the second of a pair
    std::int64_t count = 0;
};

// The pairs of one pose, and what finding them needs; kept from pose to pose, for fresh memory costs more than the search.
struct Pairs {
    PairList thick;       // two volumes about their cores, see `Outline`
    PairList others;      // a box or a hull with whatever
    Array<Pair> left;     // by the sieve
    PairList with_world;  // what touches an object, before it is put where it belongs
    Near near;
};

// Find the pairs whose balls are nearer than the skin [m].
void find_pairs(const Scene& scene, const Placed& placed, double skin, Pairs& pairs);

// Leave those of the pairs that may be nearer than the skin: most of those whose balls are have nothing to do with each other.
void sieve(const Scene& scene, Placed& placed, double skin, Pairs& pairs);

}  // namespace mobee
