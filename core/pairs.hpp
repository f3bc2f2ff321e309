// Which pairs of volumes may touch in a pose, found in three steps: balls about clusters, balls about volumes, and the sieve.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "scene.hpp"

namespace mobee {

// A shape, and a shape or, from the number of shapes on, a free object.
struct Pair {
    std::int32_t first = 0, second = 0;
};

// What is near one cluster.
struct Near {
    double x, y, z, bound;
    std::int32_t object;
};

// The pairs of one pose, and what finding them needs; kept from pose to pose, for fresh memory costs more than the search.
struct Pairs {
    Array<Pair> list;
    Array<Near> near;
};

// Put the pairs in the list whose balls are nearer than the skin [m].
void find_pairs(const Scene& scene, const Placed& placed, double skin, Pairs& pairs);

// Keep those of the pairs that may overlap, in their order: most of those whose balls do have nothing to do with each other.
void sieve(const Scene& scene, Placed& placed, Array<Pair>& pairs);

}  // namespace mobee
