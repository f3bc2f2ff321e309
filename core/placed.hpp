// A robot as it stands in one pose: its links, its shapes, and balls about clusters of shapes.
#pragma once

#include <cstdint>

#include "kinematics.hpp"
#include "robot.hpp"

namespace mobee {

// What is read of a volume before anything is known of its neighbours: a segment, a point if it has no core, and how far the volume
// reaches from it.
struct Outline {
    Four center, core;
    double radius = 0.0, bound = 0.0, squared = 0.0, inverse = 0.0;  // see `Volume`
    Kind kind = Kind::sphere;
};

Outline outline_of(const Volume& volume);

struct Ball {
    double x = 0.0, y = 0.0, z = 0.0, radius = 0.0;
};

// A radius of the broad phase: larger by more than rounding, so that it hides nothing that the narrow phase would find.
inline double roomy(double radius) { return radius * (1.0 + 1e-9) + 1e-9; }

struct Placed {
    Links links;
    Array<Outline> outline;  // (shapes,)
    Array<double> x, y, z;   // (shapes,): the centres once more, as columns
    Array<Ball> ball;        // (clusters,): each holds the shapes of one
    Array<Volume> volume;    // (shapes,): those that are `whole` have been placed; see `placed_volume`
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
const Volume& placed_volume(const Robot& robot, Placed& placed, std::int64_t shape);

}  // namespace mobee
