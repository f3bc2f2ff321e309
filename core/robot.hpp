// SPDX-License-Identifier: Apache-2.0
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

// A volume in a table that Python makes, see mobee/model/volumes.py.
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

// What is read of a volume before anything is known of its neighbours.  Nothing of the volume is farther from its core than the radius,
// but of boxes and hulls, which have none.
struct Outline {
    Four center;  // the fourth is the radius
    Four core;    // half of it; the fourth is 1 over its square, 0 where it is a point
};

// A box about the centre that holds a volume: the rows of its rotation, and its half edges.
struct Box {
    Four row[3];
    Four half;
};

struct Cluster {
    std::int64_t first = 0, end = 0;  // slots
};

// A slot that is tested against some of `lanes` later ones in a row.
struct Strip {
    std::int32_t slot = 0, start = 0;
    std::uint32_t tested = 0;  // bits
};

// Two clusters, or one with itself, of which some shapes are tested, and their strips: of pairs of thick volumes, and of all others.
struct ClusterPair {
    std::int64_t first = 0, second = 0;
    std::int64_t thick = 0, others = 0, end = 0;  // where in the strips the first begin, the others, and where they end
};

struct Robot {
    std::int64_t serial = 0;  // no two robots have the same
    std::int64_t motors = 0, joints = 0, links = 0, drives = 0;  // drives: the largest number of motors on one joint
    std::int64_t own_shapes = 0;                                 // without what is carried
    Array<Joint> joint;         // (joints,)
    Array<std::int64_t> motor;  // (drives, joints): which motor
    Array<double> scale;        // (drives, joints): by how much it turns the joint
    Array<double> offset;       // (joints,)
    Array<double> span;         // (joints,): how far a joint is from the one before [m]

    // Shapes stand in slots, cluster by cluster; each cluster begins at a multiple of `lanes`, and slots between them hold nothing.
    Array<Shape> shape;            // (slots,)
    Array<Outline> outline;        // (slots,)
    Array<std::int64_t> link;      // (slots,): that of the shape
    Array<float> bound;            // (slots,): of their balls, see `roomy`; less than nothing where there is no shape
    Array<bool> thick;             // (slots,): no box nor hull, see `Outline`
    Array<Cluster> cluster;
    Array<ClusterPair> cluster_pair;
    Array<Strip> strip;
    Array<std::int32_t> common;        // (links, links): the last link that carries both
    Array<Vec3> corner;                // of all hulls
    Array<std::int32_t> edge_start, edge;  // of their corners, see `Hull`; empty, or for all of them

    std::int64_t slots() const { return static_cast<std::int64_t>(shape.size()); }
};

// A radius of the broad phase, larger by more than single precision rounds, so that it hides nothing that the narrow phase would find;
// `far`: how far from the origin anything is whose place is rounded.
inline float roomy(double radius, double far = 0.0) { return static_cast<float>(radius * (1.0 + 1e-6) + 1e-6 * far + 1e-9); }

// Whether a volume lies within its radius of its core.
inline bool is_thick(Kind kind) { return kind <= Kind::cylinder; }

Outline outline_of(const Volume& volume);
Box box_of(const Volume& volume);

// The volume of a row in its own place, with the corners that stand in a table from its first one on.
Volume volume_of(const VolumeRow& row, const Robot& owner);

}  // namespace mobee
