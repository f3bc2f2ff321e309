// SPDX-License-Identifier: Apache-2.0
// A robot as it stands in one pose: its links, its shapes, and balls about clusters of shapes.
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
    Array<float> x, y, z;    // (slots,): the centres once more, as columns
    float margin = 0.0f;     // m: more than single precision rounds here
    Array<Ball> ball;        // (clusters,): each holds the shapes of one
    Array<Volume> volume;    // (slots,): those that are `whole` have been placed, see `placed_volume`
    Array<Box> box;          // (slots,): like `volume`
    Array<bool> whole;
    std::int64_t serial = 0;  // of the robot that it fits

    // Make it fit a robot; costs nothing if it is the last one.
    void fit(const Robot& robot);
};

// Place all links and shapes at the angles of the links.
void place(const Robot& robot, Placed& placed);

// Place one shape where its link is.
void place_shape(const Robot& robot, std::int64_t shape, Placed& placed);

// Fill the balls.
void bound_clusters(const Robot& robot, Placed& placed);

// A shape, placed wholly when it is first asked for: few of them come near another.
const Volume& placed_volume(const Robot& robot, Placed& placed, std::int64_t slot);

}  // namespace mobee
