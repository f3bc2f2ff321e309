// SPDX-License-Identifier: Apache-2.0
// Whether straight motions from pose to pose touch anything: the middle of each first, and no pose more after the first that touches.
//
// What is found in a pose does not depend on the poses before, so threads change nothing.
#include <cstdint>

#include "interface.hpp"
#include "neighbours.hpp"
#include "threads.hpp"

namespace mobee {

// What Python asks, see mobee/_core/edges.py.
struct Motions {
    Neighbours* const* near;      // (threads,): what each remembers, all in one world
    const double* q;              // (vertices, motors)
    const std::int64_t* edges;    // (count, 2): vertices
    const std::int64_t* between;  // (count,): how many poses there are between the ends, which themselves are not looked at
    bool* free;                   // (count,): filled
    std::int64_t count, motors, threads;
};

namespace sweeping {

constexpr std::int64_t at_once = 16;  // edges that follow each other are near each other, so that a list of neighbours serves them

struct Stretch {
    std::int64_t first, last;
};

// One thread's.
struct Sweeper {
    const Motions* motions = nullptr;
    Neighbours* near = nullptr;
    std::int64_t looked = 0;  // at so many poses
    Array<Stretch> stretches;  // of poses of which none was looked at, the long ones first
    Array<double> pose;        // (motors,)

    bool is_free(std::int64_t edge) {
        const std::int64_t motors = motions->motors, between = motions->between[edge];
        const double *a = motions->q + motions->edges[2 * edge] * motors, *b = motions->q + motions->edges[2 * edge + 1] * motors;
        const double share = 1.0 / (static_cast<double>(between) + 1.0);
        stretches.clear();
        if (between > 0) stretches.push({1, between});
        for (std::size_t done = 0; done < stretches.size(); ++done) {
            const Stretch here = stretches[done];
            const std::int64_t middle = (here.first + here.last) / 2;
            for (std::int64_t k = 0; k < motors; ++k) pose[k] = a[k] + (b[k] - a[k]) * (share * static_cast<double>(middle));
            ++looked;
            if (find(*near, pose.data()) > 0) return false;
            if (here.first < middle) stretches.push({here.first, middle - 1});
            if (middle < here.last) stretches.push({middle + 1, here.last});
        }
        return true;
    }
};

}  // namespace sweeping

// Find which edges are free; returns how many poses were looked at.
MOBEE_CALL std::int64_t mobee_sweep(const Motions* motions) {
    Array<sweeping::Sweeper*> sweepers;
    for (std::int64_t k = 0; k < motions->threads; ++k) {
        sweepers.push(make<sweeping::Sweeper>());
        sweepers[k]->motions = motions;
        sweepers[k]->near = motions->near[k];
        sweepers[k]->pose.resize(motions->motors);
    }
    share(motions->count, sweeping::at_once, motions->threads, [&](std::int64_t thread, std::int64_t begin, std::int64_t end) {
        for (std::int64_t edge = begin; edge < end; ++edge) motions->free[edge] = sweepers[thread]->is_free(edge);
    });
    std::int64_t looked = 0;
    for (sweeping::Sweeper* one : sweepers) {
        looked += one->looked;
        discard(one);
    }
    return looked;
}

}  // namespace mobee
