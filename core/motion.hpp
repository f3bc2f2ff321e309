// How far shapes may have moved since an earlier pose: as seen from the base, and as seen from a link that carries them.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "robot.hpp"

namespace mobee {

// Some shapes of a link that are near each other: how far they have moved together is known at less cost than of each.
struct Group {
    std::int64_t link = 0;
    std::int64_t number = 0;  // of shapes
    Vec3 middle;              // at zero pose
    Vec3 then;                // where it was in the earlier pose
    double spread = 0.0;      // how far from the middle centres are, each with its arm [m]
};

struct Motion {
    std::int64_t serial = 0;             // of the robot that it fits
    std::int64_t pose = 0;               // number of the present pose
    Array<bool> moved;                   // (links,): since the last pose
    Array<double> last;                  // (joints,): the angles of the last pose
    Array<std::int64_t> moved_in;        // (links,): the pose in which each has moved last
    Array<std::int64_t> placed_in;       // (slots,): the pose in which each has been placed last, see `place_shapes`

    // The earlier pose.
    Array<double> angles;   // (joints,)
    Array<Frame> frame;     // (links,)
    Array<Four> center;     // (slots,), of outlines

    Array<double> arm;                // (slots,): how far from the centre points are that turn with it [m]: of a ball none, of a capsule its axis
    Array<Group> group;
    Array<std::int64_t> group_of;     // (slots,)
    Array<double> far;                // (groups + 1,), see `measure_groups`; the last stands for what does not belong to the robot
    Array<double> turned;             // (links,): by which a point 1 m from a centre that turns with the link has moved [m]
    Array<double> way;                // (slots,), see `way_of`
    Array<double> bend, sway, chain;  // (links,), see `bend_links`

    void fit(const Robot& robot);
    void make_groups(const Robot& robot);
};

// Mark the links that a joint carries whose angle differs from the last, all of them if `fresh`, and remember the angles.
void find_moved(const Robot& robot, const double* angles, bool fresh, Motion& motion);

// Let the pose be the earlier one: from now on `way` counts from here.
void remember(const Placed& placed, Motion& motion);

// Fill `far`: how far any point of any shape of a group may be from where it was [m]; returns the most of all.
double measure_groups(const Robot& robot, const Links& links, Motion& motion);

// How far any point of a shape may be from where it was [m], after `measure_groups`; places the shape if its link has moved.
double way_of(const Robot& robot, std::int64_t slot, Placed& placed, Motion& motion);

// The most of all ways; places all shapes.
double measure_shapes(const Robot& robot, Placed& placed, Motion& motion);

// Place the shapes that have moved since they were placed.
void place_shapes(const Robot& robot, Placed& placed, Motion& motion);

// Fill for every link three sums over the joints that carry it, from the base on, see `swung`.
//
// `bend` [rad]: what they have turned since then; `sway` [m]: how far that may have moved the joint of the link; `chain` [m]: how far
// the base is along the joints.
void bend_links(const Robot& robot, const double* angles, Motion& motion);

// How far a point may have moved that is `lever` from the joint of its link, as seen from a link that carries it [m].
inline double swung(const Motion& motion, std::int64_t link, std::int64_t base, double lever) {
    const double turned = motion.bend[base];
    return motion.sway[link] - motion.sway[base] - turned * (motion.chain[link] - motion.chain[base]) + (motion.bend[link] - turned) * lever;
}

}  // namespace mobee
