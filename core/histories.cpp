// SPDX-License-Identifier: Apache-2.0
// Sums over earlier observations, weighted by distance.

#include <cmath>
#include <cstdint>

#include "array.hpp"
#include "interface.hpp"

namespace mobee {

// The values of each action on each target, as sums, see mobee/learning/reaching/histories.py.
struct History {
    struct Key {
        std::int64_t action, target;
    };
    struct Sum {
        double values, count;
    };
    const double* targets;  // (known, 3) m
    const Key* keys;        // (used,)
    const Sum* sums;        // (used,)
    std::int64_t known, used;
    double scale;  // m: the weight of a target at a distance d is 1 / (1 + d / scale),
    double near;   // m: the weight is 0 beyond this distance
};

namespace histories {

constexpr double far = 30.0;  // squared distance at which a Gaussian weight, 3e-7, counts as 0

}  // namespace histories

// Sum the weighted values of each action on targets near this one (3,) m, and the weights, each (actions,).
MOBEE_CALL void mobee_weighted_sums(const History* history, const double* target, double* totals, double* weights) {
    Array<double> weight(history->known);
    for (std::int64_t i = 0; i < history->known; ++i) {
        const double* one = history->targets + 3 * i;
        const double x = one[0] - target[0], y = one[1] - target[1], z = one[2] - target[2];
        const double distance = std::sqrt(x * x + y * y + z * z);
        weight[i] = distance <= history->near ? 1.0 / (1.0 + distance / history->scale) : 0.0;
    }
    for (std::int64_t k = 0; k < history->used; ++k) {
        const History::Key key = history->keys[k];
        totals[key.action] += weight[key.target] * history->sums[k].values;
        weights[key.action] += weight[key.target] * history->sums[k].count;
    }
}

// Add to `sums` (2, points), for each point (points, d), the weighted sum of the events' values, and the sum of the weights.
// Events are rows of a point and a value, (events, d + 1).  The weight at a distance r is exp(-r^2 / 2).
MOBEE_CALL void mobee_gaussian_sums(const double* asked, std::int64_t points, std::int64_t d, const double* events, std::int64_t count, double* sums) {
    for (std::int64_t k = 0; k < count; ++k) {
        const double* event = events + k * (d + 1);
        for (std::int64_t i = 0; i < points; ++i) {
            double square = 0.0;
            for (std::int64_t axis = 0; axis < d && square <= histories::far; ++axis) {
                const double gap = asked[i * d + axis] - event[axis];
                square += gap * gap;
            }
            if (!(square <= histories::far)) continue;
            const double weight = std::exp(-0.5 * square);
            sums[i] += weight * event[d];
            sums[points + i] += weight;
        }
    }
}

}  // namespace mobee
