// How far shapes may have moved since an earlier pose: as seen from the base, and as seen from a link that carries them.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "robot.hpp"

namespace mobee {

struct Motion {
    Array<bool> moved;   // (links,): since the last pose
    Array<double> last;  // (joints,): the angles of the last pose

    // The earlier pose.
    Array<double> angles;   // (joints,)
    Array<Frame> frame;     // (links,)
    Array<Four> center;     // (slots,), of outlines

    Array<double> arm;                // (slots,): how far from the centre points are that turn with it [m]: of a ball none, of a capsule its axis
    Array<double> way;                // (slots,), see `measure`
    Array<double> turned;             // (links,), see `measure`
    Array<double> bend, sway, chain;  // (links,), see `bend_links`

    void fit(const Robot& robot);
};

// Mark the links that a joint carries whose angle differs from the last, all of them if `fresh`, and remember the angles.
void find_moved(const Robot& robot, const double* angles, bool fresh, Motion& motion);

// Let the pose be the earlier one: from now on `way` counts from here.
void remember(const Placed& placed, Motion& motion);

// Fill how far any point of a shape that moved may be from where it was, `way` [m]; returns the most of all.
//
// Stops as soon as it is `enough` [m]; what is filled is then of no use.
double measure(const Robot& robot, const Placed& placed, double enough, Motion& motion);

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
