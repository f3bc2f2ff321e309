// SPDX-License-Identifier: Apache-2.0
// Checks straight motions between poses for contacts: the middle of each first, and no further pose after the first with a contact.
//
// The result for a pose does not depend on the poses before, so the number of threads changes nothing.
#include <cstdint>

#include "interface.hpp"
#include "neighbours.hpp"
#include "threads.hpp"

namespace mobee {

// The arguments from Python, see mobee/_core/roadmap.py.
struct Motions {
    Neighbours* const* near;      // (threads,): the neighbour list of each, all in one world
    const double* q;              // (vertices, motors)
    const std::int64_t* edges;    // (count, 2): vertices
    const std::int64_t* between;  // (count,): number of poses to check between the ends, which are not checked
    bool* free;                   // (count,): filled
    std::int64_t count, motors, threads;
};

namespace sweeping {

constexpr std::int64_t at_once = 16;  // successive edges are near each other, so that one neighbour list serves them

struct Stretch {
    std::int64_t first, last;
};

// The work of one thread.
struct Sweeper {
    const Motions* motions = nullptr;
    Neighbours* near = nullptr;
    std::int64_t checked = 0;  // number of poses
    Array<Stretch> stretches;  // of poses that are still to be checked, the long ones first
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
            ++checked;
            if (find(*near, pose.data()) > 0) return false;
            if (here.first < middle) stretches.push({here.first, middle - 1});
            if (middle < here.last) stretches.push({middle + 1, here.last});
        }
        return true;
    }
};

}  // namespace sweeping

// Find which edges are free; returns the number of poses that were checked.
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
    std::int64_t checked = 0;
    for (sweeping::Sweeper* one : sweepers) {
        checked += one->checked;
        discard(one);
    }
    return checked;
}

}  // namespace mobee
