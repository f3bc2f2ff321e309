// SPDX-License-Identifier: Apache-2.0
// Pairs of volumes, for tests and benchmarks.
#include "interface.hpp"

#include "narrow.hpp"
#include "touch_along.hpp"

MOBEE_CALL std::int64_t mobee_volume_size() { return sizeof(mobee::Volume); }

MOBEE_CALL void mobee_overlap(const mobee::Volume* first, const mobee::Volume* second, std::int64_t count, double* depth, mobee::Touch* touch) {
    for (std::int64_t k = 0; k < count; ++k) depth[k] = mobee::overlap(first[k], second[k], touch[k]);
}

MOBEE_CALL void mobee_distance(const mobee::Volume* first, const mobee::Volume* second, std::int64_t count, double* distance) {
    for (std::int64_t k = 0; k < count; ++k) distance[k] = mobee::distance(first[k], second[k]);
}

MOBEE_CALL std::int64_t mobee_cut(const double* points, std::int64_t count, const double* line, double* out, std::int64_t room) {
    using mobee::narrow::Point;
    return mobee::narrow::cut(reinterpret_cast<const Point*>(points), static_cast<int>(count), {line[0], line[1]}, {line[2], line[3]},
                              reinterpret_cast<Point*>(out), static_cast<int>(room));
}
