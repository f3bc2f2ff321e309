// SPDX-License-Identifier: Apache-2.0
// A robot in one pose: its links, its shapes, and balls about clusters of shapes.
#pragma once

#include <cstdint>

#include "kinematics.hpp"
#include "robot.hpp"

namespace mobee {

struct Ball {
    float x = 0.0f, y = 0.0f, z = 0.0f, radius = 0.0f;
};

struct Placed {
    Links links;
    Array<Outline> outline;  // (slots,)
    Array<float> x, y, z;    // (slots,): the centres in single precision, as columns
    float margin = 0.0f;     // m: larger than the rounding errors of single precision here
    Array<Ball> ball;        // (clusters,): each encloses the shapes of one cluster
    Array<Volume> volume;    // (slots,): those that are `whole` have been placed, see `placed_volume`
    Array<Box> box;          // (slots,): valid where `volume` is
    Array<bool> whole;
    std::int64_t serial = 0;  // of the robot for which it was made

    // Prepare it for a robot; returns at once if that is the same as before.
    void fit(const Robot& robot);
};

// Place all links and shapes at the angles of the links.
void place(const Robot& robot, Placed& placed);

// Place one shape at its link.
void place_shape(const Robot& robot, std::int64_t shape, Placed& placed);

// Compute the balls of the clusters.
void bound_clusters(const Robot& robot, Placed& placed);

// Return the volume of a shape, which is placed completely at the first request, since few shapes come near another.
const Volume& placed_volume(const Robot& robot, Placed& placed, std::int64_t slot);

}  // namespace mobee
