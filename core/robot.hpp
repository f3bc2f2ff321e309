// SPDX-License-Identifier: Apache-2.0
// A robot in the core: joints, motors, shapes, and the pairs of shapes that are tested against each other.  It never changes.
#pragma once

#include <cstdint>

#include "array.hpp"
#include "vector.hpp"
#include "volume.hpp"

namespace mobee {

// A joint moves link j + 1, which its parent, a link with a smaller number, carries.  Its motion is I + s S + c C: s and c are the
// sine and 1 - cosine of its angle; for a prismatic joint, s is its position and c is 0.
struct Joint {
    Frame S, C;
    std::int64_t parent = 0;
    bool slides = false;
    bool border = false;  // the link it moves belongs to another part than its parent
    Vec3 axis, point;     // root frame at zero pose
};

// A volume in a table that Python makes, see mobee/model/core_tables.py.
struct VolumeRow {
    std::int64_t kind;
    Vec3 position;
    Rotation rotation;
    Vec3 half;  // half sizes; for a convex volume, its first corner in the table of corners and their number
    double bound;
};

// A shape on its link, in the link's axes at zero pose.
struct Shape {
    Volume volume;
    std::int64_t link = 0;
    std::int64_t name = 0;  // index in the robot file; from the number of own shapes on, index among the carried objects
    bool field = false;
    bool meets_world = false;
    double lever = 0.0;  // largest distance of its points from the joint of its link [m], see `swung`
};

// The part of a volume that the broad phase reads.  All points of the volume are within the radius of its core,
// except for boxes and hulls, which have no core.
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

// A slot that is tested against some of `lanes` successive later slots.
struct Strip {
    std::int32_t slot = 0, start = 0;
    std::uint32_t tested = 0;  // bits
};

// Two clusters (or one with itself) with tested pairs of shapes, and their strips: pairs of thick volumes, then all others.
struct ClusterPair {
    std::int64_t first = 0, second = 0;
    std::int64_t thick = 0, others = 0, end = 0;  // indices in the strips: begin of the thick ones, begin of the others, end
};

struct Robot {
    std::int64_t serial = 0;  // no two robots have the same
    std::int64_t motors = 0, joints = 0, links = 0, drives = 0;  // drives: the largest number of motors on one joint
    std::int64_t own_shapes = 0;                                 // without carried objects
    Array<Joint> joint;         // (joints,)
    Array<std::int64_t> motor;  // (drives, joints): index of the motor
    Array<double> scale;        // (drives, joints): motion of the joint per motion of the motor
    Array<double> offset;       // (joints,)
    Array<double> span;         // (joints,): distance of a joint from the one before [m]
    Array<double> travel;       // (drives, joints): motion of the joint when the motor moves by the angle 1 of the law
    double least_lever = 0.0;   // m; above 0: contacts push by the motion that undoes them, see `push_of`

    // Shapes stand in slots, cluster by cluster; each cluster begins at a multiple of `lanes`, and slots between them hold nothing.
    Array<Shape> shape;            // (slots,)
    Array<Outline> outline;        // (slots,)
    Array<std::int64_t> link;      // (slots,): link of the shape
    Array<float> bound;            // (slots,): radii of their balls, see `roomy`; negative in empty slots
    Array<bool> thick;             // (slots,): neither a box nor a hull, see `Outline`
    Array<Cluster> cluster;
    Array<ClusterPair> cluster_pair;
    Array<Strip> strip;
    Array<std::int32_t> common;        // (links, links): the last link that carries both
    Array<Vec3> corner;                // of all hulls
    Array<std::int32_t> edge_start, edge;  // of the corners, see `Hull`; empty, or for all hulls

    std::int64_t slots() const { return static_cast<std::int64_t>(shape.size()); }
};

// A radius for the broad phase, larger than the exact one by more than the rounding of single precision, so that no contact is missed;
// `far`: largest distance from the origin of any position that is rounded [m].
inline float roomy(double radius, double far = 0.0) { return static_cast<float>(radius * (1.0 + 1e-6) + 1e-6 * far + 1e-9); }

// Whether a volume lies within its radius of its core.
inline bool is_thick(Kind kind) { return kind <= Kind::cylinder; }

Outline outline_of(const Volume& volume);
Box box_of(const Volume& volume);

// Return the volume of a row at its own position; `corner`: the table of corners.
Volume volume_of(const VolumeRow& row, const Robot& owner);

}  // namespace mobee
