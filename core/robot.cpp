// SPDX-License-Identifier: Apache-2.0
#include "robot.hpp"

#include <atomic>
#include <limits>

#include "interface.hpp"
#include "lanes.hpp"

namespace mobee {

// The tables of a robot as Python makes them, see mobee/model/core_tables.py; all are copied.
struct RobotTables {
    std::int64_t motors, joints, drives, shapes, own_shapes, clusters, corners, edges;
    const std::int64_t *parent, *slides, *border;         // (joints,)
    const Vec3 *axis, *point;                             // (joints,)
    const std::int64_t* motor;                            // (drives, joints)
    const double *scale, *offset;                         // (drives, joints), (joints,)
    const VolumeRow* volume;                              // (shapes,)
    const std::int64_t *link, *name, *field, *meets_world;  // (shapes,)
    const std::int64_t* cluster;                          // (clusters + 1,): first shape of each
    const unsigned char* tested;                          // (shapes, shapes)
    const Vec3* corner;                                   // (corners,)
    const std::int32_t *edge_start, *edge;                // (corners + 1,), (edges,)
    const double* travel;                                 // (drives, joints)
    double least_lever;
};

namespace robots {

Frame columns(Vec3 x, Vec3 y, Vec3 z, Vec3 shift) { return Frame{four(x), four(y), four(z), four(shift)}; }

// Gupta's form of a turn about a line (thesis 2.3.1): S turns as u x, C as u u^T - I, and both shift so that the line stays.
void set_motion(Joint& joint) {
    const Vec3 u = joint.axis, p = joint.point;
    if (joint.slides) {
        joint.S = columns({}, {}, {}, u);
        joint.C = columns({}, {}, {}, {});
        return;
    }
    const Vec3 x{u.x * u.x - 1.0, u.y * u.x, u.z * u.x}, y{u.x * u.y, u.y * u.y - 1.0, u.z * u.y}, z{u.x * u.z, u.y * u.z, u.z * u.z - 1.0};
    joint.S = columns({0.0, u.z, -u.y}, {-u.z, 0.0, u.x}, {u.y, -u.x, 0.0}, -cross(u, p));
    joint.C = columns(x, y, z, -(p.x * x + p.y * y + p.z * z));
}

void set_joints(Robot& robot, const RobotTables& from) {
    robot.joint.resize(static_cast<std::size_t>(from.joints));
    for (std::int64_t j = 0; j < from.joints; ++j) {
        Joint& joint = robot.joint[j];
        joint.parent = from.parent[j];
        joint.slides = from.slides[j] != 0;
        joint.border = from.border[j] != 0;
        joint.axis = from.axis[j];
        joint.point = from.point[j];
        set_motion(joint);
    }
    robot.motor = Array<std::int64_t>(from.motor, from.drives * from.joints);
    robot.scale = Array<double>(from.scale, from.drives * from.joints);
    robot.offset = Array<double>(from.offset, from.joints);
    robot.travel = Array<double>(from.travel, from.drives * from.joints);
    robot.least_lever = from.least_lever;
}

// Compute the distance of every joint from the one before, and the largest distance of every shape's points from the joint of its link.
// A joint is represented by the point of its axis that is nearest to the joint before, the base by its origin.
void set_levers(Robot& robot) {
    Array<Vec3> at(robot.links);
    robot.span.resize(robot.joints);
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        const Joint& joint = robot.joint[j];
        const Vec3 before = at[joint.parent];
        at[j + 1] = joint.point + dot(before - joint.point, joint.axis) * joint.axis;
        robot.span[j] = length(at[j + 1] - before);
    }
    for (Shape& shape : robot.shape) {
        const Volume& volume = shape.volume;
        const bool rounded = volume.kind <= Kind::capsule;
        shape.lever = length(volume.center - at[shape.link]) + volume.bound - (rounded ? volume.radius : 0.0);
    }
}

void set_common(Robot& robot) {
    robot.common.resize(robot.links * robot.links);
    for (std::int64_t a = 0; a < robot.links; ++a) {
        robot.common[a * robot.links + a] = static_cast<std::int32_t>(a);
        for (std::int64_t b = 0; b < a; ++b) {
            const std::int32_t both = robot.common[robot.joint[a - 1].parent * robot.links + b];
            robot.common[a * robot.links + b] = robot.common[b * robot.links + a] = both;
        }
    }
}

void set_shapes(Robot& robot, const RobotTables& from) {
    robot.corner = Array<Vec3>(from.corner, from.corners);
    robot.edge_start = Array<std::int32_t>(from.edge_start, from.corners + 1);
    robot.edge = Array<std::int32_t>(from.edge, from.edges);
    std::int64_t slots = 0;
    for (std::int64_t c = 0; c < from.clusters; ++c) {
        const std::int64_t count = from.cluster[c + 1] - from.cluster[c];
        robot.cluster.push({slots, slots + count});
        slots += (count + lanes - 1) / lanes * lanes;
    }
    robot.shape.resize(slots);
    robot.outline.resize(slots);
    robot.link.resize(slots);
    robot.bound.resize(slots);
    for (float& bound : robot.bound) bound = -std::numeric_limits<float>::max();
    robot.thick.resize(slots);
    for (std::int64_t c = 0; c < from.clusters; ++c) {
        for (std::int64_t k = 0; k < from.cluster[c + 1] - from.cluster[c]; ++k) {
            const std::int64_t slot = robot.cluster[c].first + k, i = from.cluster[c] + k;
            Shape& shape = robot.shape[slot];
            shape.volume = volume_of(from.volume[i], robot);
            shape.link = from.link[i];
            shape.name = from.name[i];
            shape.field = from.field[i] != 0;
            shape.meets_world = from.meets_world[i] != 0;
            robot.outline[slot] = outline_of(shape.volume);
            robot.link[slot] = shape.link;
            robot.bound[slot] = roomy(shape.volume.bound);
            robot.thick[slot] = is_thick(shape.volume.kind);
        }
    }
}

// Add the strips of two clusters: of pairs of two thick volumes, or of all other pairs.
void add_strips(Robot& robot, const RobotTables& from, std::int64_t a, std::int64_t b, bool thick) {
    const Cluster rows = robot.cluster[a], columns = robot.cluster[b];
    for (std::int64_t i = rows.first; i < rows.end; ++i) {
        const unsigned char* tested = from.tested + (from.cluster[a] + i - rows.first) * from.shapes + from.cluster[b];
        for (std::int64_t start = columns.first; start < columns.end; start += lanes) {
            Strip strip{static_cast<std::int32_t>(i), static_cast<std::int32_t>(start), 0};
            for (std::int64_t j = start; j < columns.end && j < start + lanes; ++j) {
                const bool wanted = (robot.thick[i] && robot.thick[j]) == thick && (a != b || i < j);
                if (wanted && tested[j - columns.first] != 0) strip.tested |= 1u << (j - start);
            }
            if (strip.tested != 0) robot.strip.push(strip);
        }
    }
}

void set_pairs(Robot& robot, const RobotTables& from) {
    const auto strips = [&] { return static_cast<std::int64_t>(robot.strip.size()); };
    for (std::int64_t a = 0; a < from.clusters; ++a) {
        for (std::int64_t b = a; b < from.clusters; ++b) {
            ClusterPair pair{a, b, strips(), 0, 0};
            add_strips(robot, from, a, b, true);
            pair.others = strips();
            add_strips(robot, from, a, b, false);
            pair.end = strips();
            if (pair.end > pair.thick) robot.cluster_pair.push(pair);
        }
    }
}

std::int64_t next_serial() {
    static std::atomic<std::int64_t> last{0};
    return ++last;
}

}  // namespace robots

Volume volume_of(const VolumeRow& row, const Robot& owner) {
    Volume volume;
    volume.kind = static_cast<Kind>(row.kind);
    volume.center = row.position;
    volume.rotation = row.rotation;
    volume.bound = row.bound;
    if (volume.kind == Kind::convex) {
        const auto first = static_cast<std::int64_t>(row.half.x);
        volume.hull.corners = owner.corner.data() + first;
        volume.hull.count = static_cast<std::int32_t>(row.half.y);
        const std::int32_t* starts = owner.edge_start.data() + first;
        if (starts[volume.hull.count] > starts[0]) {
            volume.hull.starts = starts;
            volume.hull.edges = owner.edge.data();
        }
        return volume;
    }
    volume.half = row.half;
    if (volume.kind != Kind::box) volume.radius = row.half.x;
    if (volume.kind == Kind::capsule || volume.kind == Kind::cylinder) {
        volume.core = row.half.y * row.rotation.column(2);
        volume.squared = row.half.y * row.half.y;
        volume.inverse = volume.squared > 0.0 ? 1.0 / volume.squared : 0.0;
    }
    return volume;
}

Outline outline_of(const Volume& volume) {
    const Vec3 c = volume.center, u = volume.core;
    return {Four{c.x, c.y, c.z, volume.radius}, Four{u.x, u.y, u.z, volume.inverse}};
}

Box box_of(const Volume& volume) {
    Vec3 half = volume.half;
    if (volume.kind == Kind::convex) {
        for (std::int32_t k = 0; k < volume.hull.count; ++k) {
            const Vec3 corner = volume.hull.corners[k];
            half = {most(half.x, std::fabs(corner.x)), most(half.y, std::fabs(corner.y)), most(half.z, std::fabs(corner.z))};
        }
    }
    const double* m = volume.rotation.m;
    return {{Four{m[0], m[1], m[2], 0.0}, Four{m[3], m[4], m[5], 0.0}, Four{m[6], m[7], m[8], 0.0}}, four(half)};
}

MOBEE_CALL Robot* mobee_robot_new(const RobotTables* from) {
    Robot* robot = make<Robot>();
    robot->serial = robots::next_serial();
    robot->motors = from->motors;
    robot->joints = from->joints;
    robot->links = from->joints + 1;
    robot->drives = from->drives;
    robot->own_shapes = from->own_shapes;
    robots::set_joints(*robot, *from);
    robots::set_shapes(*robot, *from);
    robots::set_levers(*robot);
    robots::set_common(*robot);
    robots::set_pairs(*robot, *from);
    return robot;
}

MOBEE_CALL void mobee_robot_free(Robot* robot) { discard(robot); }

}  // namespace mobee
