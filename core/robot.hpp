// A robot as the core reads it: joints, motors, shapes, and which of them are tested against each other.
#pragma once

#include <cstdint>

#include "array.hpp"
#include "vector.hpp"
#include "volume.hpp"

namespace mobee {

// A joint moves link j + 1, which its parent, a link with a smaller number, carries.  Its motion is I + sin(a) S + (1 - cos(a)) C.
struct Joint {
    std::int64_t parent = 0;
    bool slides = false;
    bool border = false;  // the link it moves belongs to another part than its parent
    Vec3 axis, point;     // root frame at zero pose
    Vec3 diagonal, beside;  // of u u^T - I, u the axis: (xx, yy, zz) and (xy, xz, yz)
    Vec3 sine, cosine;      // what sin(a) and 1 - cos(a) shift; where it slides, `sine` is the axis
};

// What a shape is on its link, in the link's axes at zero pose.
struct Shape {
    Volume volume;
    std::int64_t link = 0;
    std::int64_t name = 0;     // number in the robot file; from the number of own shapes on, which carried object
    bool field = false;
    bool meets_world = false;
};

struct Cluster {
    std::int64_t first = 0, end = 0;  // shapes
};

struct ClusterPair {
    std::int64_t first = 0, second = 0;
};

struct Robot {
    std::int64_t motors = 0, joints = 0, links = 0, drives = 0;  // drives: the largest number of motors on one joint
    std::int64_t own_shapes = 0;                                 // without what is carried
    Array<Joint> joint;        // (joints,)
    Array<std::int64_t> motor;  // (drives, joints): which motor
    Array<double> scale;       // (drives, joints): by how much it turns the joint
    Array<double> offset;      // (joints,)
    Array<Shape> shape;        // in the order of clusters
    Array<Cluster> cluster;
    Array<ClusterPair> cluster_pair;  // those of which some shapes are tested
    Array<double> reach;              // (shapes, shapes): squared distance of centres up to which a pair may touch, -1 where it is not tested
    Array<Vec3> corner;               // of all hulls
    Array<std::int32_t> edge_start, edge;
};

}  // namespace mobee
