// A robot as the core reads it: joints, motors, shapes, and which of them are tested against each other.  It never changes.
#pragma once

#include <cstdint>

#include "array.hpp"
#include "vector.hpp"
#include "volume.hpp"

namespace mobee {

// A joint moves link j + 1, which its parent, a link with a smaller number, carries.  Its motion is I + s S + c C: s and c are the
// sine and 1 - cosine of its angle, where it slides the way and 0.
struct Joint {
    Frame S, C;
    std::int64_t parent = 0;
    bool slides = false;
    bool border = false;  // the link it moves belongs to another part than its parent
    Vec3 axis, point;     // root frame at zero pose
};

// A volume in a table that Python makes, see mobee/engine/volumes.py.
struct VolumeRow {
    std::int64_t kind;
    Vec3 position;
    Rotation rotation;
    Vec3 half;  // of a convex one its first corner in the table of corners, and their number
    double bound;
};

// What a shape is on its link, in the link's axes at zero pose.
struct Shape {
    Volume volume;
    std::int64_t link = 0;
    std::int64_t name = 0;  // number in the robot file; from the number of own shapes on, which carried object
    bool field = false;
    bool meets_world = false;
    double lever = 0.0;  // how far its points are from the joint of its link, see `swung`
};

struct Cluster {
    std::int64_t first = 0, end = 0;  // shapes
};

struct ClusterPair {
    std::int64_t first = 0, second = 0;
};

struct Robot {
    std::int64_t serial = 0;  // no two robots have the same
    std::int64_t motors = 0, joints = 0, links = 0, drives = 0;  // drives: the largest number of motors on one joint
    std::int64_t own_shapes = 0;                                 // without what is carried
    Array<Joint> joint;         // (joints,)
    Array<std::int64_t> motor;  // (drives, joints): which motor
    Array<double> scale;        // (drives, joints): by how much it turns the joint
    Array<double> offset;       // (joints,)
    Array<Shape> shape;         // in the order of clusters
    Array<Cluster> cluster;
    Array<ClusterPair> cluster_pair;  // those of which some shapes are tested
    Array<double> reach;  // (shapes, shapes): squared distance of centres up to which a pair may touch, -1 where it is not tested
    Array<double> span;                // (joints,): how far a joint is from the one before [m]
    Array<std::int32_t> common;        // (links, links): the last link that carries both
    Array<Vec3> corner;                // of all hulls
    Array<std::int32_t> edge_start, edge;  // of their corners, see `Hull`; empty, or for all of them

    std::int64_t shapes() const { return static_cast<std::int64_t>(shape.size()); }
};

// The volume of a row in its own place, with the corners that stand in a table from its first one on.
Volume volume_of(const VolumeRow& row, const Robot& owner);

}  // namespace mobee
