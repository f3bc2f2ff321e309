// SPDX-License-Identifier: Apache-2.0
// Bounds of the motion of shapes since an earlier pose, relative to the base and relative to a link that carries them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "placed.hpp"
#include "robot.hpp"

namespace mobee {

// A group of shapes of one link that are near each other; one bound for a group takes less time than one for each shape.
struct Group {
    std::int64_t link = 0;
    std::int64_t number = 0;  // number of shapes
    Vec3 middle;              // at zero pose
    Vec3 then;                // its position in the earlier pose
    double spread = 0.0;      // largest distance of a centre from the middle, plus its arm [m]
};

struct Motion {
    std::int64_t serial = 0;             // of the robot for which it was made
    std::int64_t pose = 0;               // number of the present pose
    Array<bool> moved;                   // (links,): since the last pose
    Array<double> last;                  // (joints,): the angles of the last pose
    Array<std::int64_t> moved_in;        // (links,): the pose in which each has moved last
    Array<std::int64_t> placed_in;       // (slots,): the pose in which each has been placed last, see `travel_of`

    // The earlier pose.
    Array<double> angles;   // (joints,)
    Array<Frame> frame;     // (links,)
    Array<Four> center;     // (slots,), of outlines

    Array<double> arm;                // (slots,): largest distance from the centre of a point whose rotation matters [m]: 0 for a ball, half the axis for a capsule
    Array<Group> group;
    Array<std::int64_t> group_of;     // (slots,)
    Array<double> far;                // (groups + 1,), see `measure_groups`; the last is for objects that do not belong to the robot
    Array<double> turned;             // (links,): motion [m], by the link's rotation, of a point at 1 m from a centre
    Array<double> travel;                // (slots,), see `travel_of`
    Array<double> bend, drift, chain;  // (links,), see `bend_links`

    void fit(const Robot& robot);
    void make_groups(const Robot& robot);
};

namespace motion {

constexpr std::int64_t most_groups = 4;  // for one link

// Call the function with every slot that holds a shape.
template <class Function>
void each_slot(const Robot& robot, Function function) {
    for (const Cluster cluster : robot.cluster)
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) function(i);
}

// Divide the shapes of a link into groups, by position along the longest side of the bounding box of their centres.
inline void group_link(const Robot& robot, std::int64_t link, Motion& to) {
    double low[3] = {1e300, 1e300, 1e300}, high[3] = {-1e300, -1e300, -1e300};
    std::int64_t number = 0;
    each_slot(robot, [&](std::int64_t i) {
        if (robot.link[i] != link) return;
        ++number;
        for (int k = 0; k < 3; ++k) {
            low[k] = least(low[k], robot.shape[i].volume.center[k]);
            high[k] = most(high[k], robot.shape[i].volume.center[k]);
        }
    });
    int longest = 0;
    for (int k = 1; k < 3; ++k)
        if (high[k] - low[k] > high[longest] - low[longest]) longest = k;
    const std::int64_t groups = std::min(number, most_groups), first = static_cast<std::int64_t>(to.group.size());
    to.group.resize(to.group.size() + groups);
    for (std::int64_t g = 0; g < groups; ++g) to.group[first + g].link = link;
    const double length = high[longest] - low[longest];
    each_slot(robot, [&](std::int64_t i) {
        if (robot.link[i] != link) return;
        const double share = length > 0.0 ? (robot.shape[i].volume.center[longest] - low[longest]) / length : 0.0;
        to.group_of[i] = first + std::min(static_cast<std::int64_t>(share * static_cast<double>(groups)), groups - 1);
    });
}

}  // namespace motion

inline void Motion::fit(const Robot& robot) {
    const std::int64_t slots = robot.slots();
    moved.resize(robot.links);
    moved_in.resize(robot.links);
    for (Array<std::int64_t>* of_slots : {&placed_in, &group_of}) of_slots->resize(slots);
    for (Array<double>* of_joints : {&last, &angles}) of_joints->resize(robot.joints);
    for (Array<double>* of_links : {&turned, &bend, &drift, &chain}) of_links->resize(robot.links);
    for (Array<double>* of_slots : {&arm, &travel}) of_slots->resize(slots);
    frame.resize(robot.links);
    if (serial == robot.serial) return;
    serial = robot.serial;
    center.resize(slots);
    make_groups(robot);
}

inline void Motion::make_groups(const Robot& robot) {
    group.clear();
    for (std::int64_t link = 0; link < robot.links; ++link) motion::group_link(robot, link, *this);
    far.clear();
    far.resize(group.size() + 1);
    motion::each_slot(robot, [&](std::int64_t i) {
        Group& one = group[group_of[i]];
        one.middle = one.middle + robot.shape[i].volume.center;
        ++one.number;
    });
    for (Group& one : group) one.middle = 1.0 / most(static_cast<double>(one.number), 1.0) * one.middle;
    motion::each_slot(robot, [&](std::int64_t i) {
        const Volume& volume = robot.shape[i].volume;
        Group& one = group[group_of[i]];
        arm[i] = volume.bound - (volume.kind <= Kind::capsule ? volume.radius : 0.0);
        one.spread = most(one.spread, length(volume.center - one.middle) + arm[i]);
    });
}

// Mark the links carried by joints whose angle differs from the last one, or all links if `fresh`, and store the angles.
inline void find_moved(const Robot& robot, const double* angles, bool fresh, Motion& motion) {
    ++motion.pose;
    motion.moved[0] = fresh;
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        motion.moved[j + 1] = motion.moved[robot.joint[j].parent] || angles[j] != motion.last[j];
        motion.last[j] = angles[j];
    }
    for (std::int64_t link = 0; link < robot.links; ++link)
        if (motion.moved[link]) motion.moved_in[link] = motion.pose;
}

// Make the present pose the earlier one, from which `travel` is measured.
inline void remember(const Placed& placed, Motion& motion) {
    const auto copy = [](const auto& from, auto& to) { std::copy(from.begin(), from.begin() + to.size(), to.begin()); };
    copy(placed.links.angles, motion.angles);
    copy(placed.links.frame, motion.frame);
    for (std::size_t i = 0; i < placed.outline.size(); ++i) motion.center[i] = placed.outline[i].center;
    std::fill(motion.travel.begin(), motion.travel.end(), 0.0);
    for (Group& one : motion.group) one.then = move(motion.frame[one.link], one.middle);
    std::fill(motion.far.begin(), motion.far.end(), 0.0);
}

// Fill `far`: the bound of the motion of any point of any shape of a group [m]; returns the largest.
inline double measure_groups(const Robot& robot, const Links& links, Motion& motion) {
    for (std::int64_t link = 0; link < robot.links; ++link) {
        if (!motion.moved[link]) continue;
        const Frame &now = links.frame[link], &before = motion.frame[link];
        const Four x = now.x - before.x, y = now.y - before.y, z = now.z - before.z;
        const Four squares = x * x + y * y + z * z;
        motion.turned[link] = std::sqrt(0.5 * (squares[0] + squares[1] + squares[2]));  // 2 sin(angle / 2)
    }
    double farthest = 0.0;
    for (std::size_t g = 0; g < motion.group.size(); ++g) {
        const Group& one = motion.group[g];
        if (motion.moved[one.link])
            motion.far[g] = length(move(links.frame[one.link], one.middle) - one.then) + motion.turned[one.link] * one.spread;
        farthest = most(farthest, motion.far[g]);
    }
    return farthest;
}

// Return a bound of the motion of any point of a shape [m], after `measure_groups`; places the shape if its link has moved.
inline double travel_of(const Robot& robot, std::int64_t i, Placed& placed, Motion& motion) {
    const std::int64_t link = robot.link[i];
    if (motion.placed_in[i] >= motion.moved_in[link]) return motion.travel[i];
    place_shape(robot, i, placed);
    motion.placed_in[i] = motion.pose;
    motion.travel[i] = length(three(placed.outline[i].center - motion.center[i])) + motion.turned[link] * motion.arm[i];
    return motion.travel[i];
}

// Return the largest bound of all shapes; places all shapes.
inline double measure_shapes(const Robot& robot, Placed& placed, Motion& motion) {
    double farthest = 0.0;
    motion::each_slot(robot, [&](std::int64_t i) { farthest = most(farthest, travel_of(robot, i, placed, motion)); });
    return farthest;
}

// Fill for every link three sums over the joints that carry it, from the base on, see `swung`.
//
// `bend` [rad]: the angles that they have turned since the earlier pose; `drift` [m]: a bound of the resulting motion of the link's joint;
// `chain` [m]: the distance from the base along the joints.
inline void bend_links(const Robot& robot, const double* angles, Motion& motion) {
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        const Joint& joint = robot.joint[j];
        const std::int64_t link = j + 1, parent = joint.parent;
        const double change = std::fabs(angles[j] - motion.angles[j]);
        const double span = robot.span[j] + (joint.slides ? std::fabs(angles[j]) : 0.0);
        motion.bend[link] = motion.bend[parent] + (joint.slides ? 0.0 : change);
        motion.drift[link] = motion.drift[parent] + motion.bend[parent] * span + (joint.slides ? change : 0.0);
        motion.chain[link] = motion.chain[parent] + span;
    }
}

// Return a bound of the motion [m] of a point at distance `lever` from the joint of its link, relative to a link that carries it.
inline double swung(const Motion& motion, std::int64_t link, std::int64_t base, double lever) {
    const double turned = motion.bend[base];
    return motion.drift[link] - motion.drift[base] - turned * (motion.chain[link] - motion.chain[base]) + (motion.bend[link] - turned) * lever;
}

}  // namespace mobee
