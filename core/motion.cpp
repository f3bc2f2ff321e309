#include "motion.hpp"

#include <algorithm>
#include <cmath>

#include "interface.hpp"

namespace mobee {

void Motion::fit(const Robot& robot) {
    const std::int64_t slots = robot.slots();
    moved.resize(robot.links);
    for (Array<double>* of_joints : {&last, &angles}) of_joints->resize(robot.joints);
    for (Array<double>* of_links : {&turned, &bend, &sway, &chain}) of_links->resize(robot.links);
    for (Array<double>* of_slots : {&arm, &way}) of_slots->resize(slots);
    frame.resize(robot.links);
    center.resize(slots);
    for (std::int64_t i = 0; i < slots; ++i) {
        const Volume& volume = robot.shape[i].volume;
        arm[i] = volume.bound - (volume.kind <= Kind::capsule ? volume.radius : 0.0);
    }
}

void find_moved(const Robot& robot, const double* angles, bool fresh, Motion& motion) {
    motion.moved[0] = fresh;
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        motion.moved[j + 1] = motion.moved[robot.joint[j].parent] || angles[j] != motion.last[j];
        motion.last[j] = angles[j];
    }
}

void remember(const Placed& placed, Motion& motion) {
    const auto copy = [](const auto& from, auto& to) { std::copy(from.begin(), from.end(), to.begin()); };
    copy(placed.links.angles, motion.angles);
    copy(placed.links.frame, motion.frame);
    for (std::size_t i = 0; i < placed.outline.size(); ++i) motion.center[i] = placed.outline[i].center;
    std::fill(motion.way.begin(), motion.way.end(), 0.0);
}

double measure(const Robot& robot, const Placed& placed, double enough, Motion& motion) {
    const std::int64_t slots = robot.slots();
    for (std::int64_t i = 0; i < slots; ++i) {
        if (!motion.moved[robot.link[i]]) continue;
        motion.way[i] = length(three(placed.outline[i].center - motion.center[i]));
        if (motion.way[i] >= enough) return motion.way[i];
    }
    for (std::int64_t link = 0; link < robot.links; ++link) {
        if (!motion.moved[link]) continue;
        const Frame &now = placed.links.frame[link], &then = motion.frame[link];
        const Four x = now.x - then.x, y = now.y - then.y, z = now.z - then.z;
        const Four squares = x * x + y * y + z * z;
        // By which a point 1 m from the centre is turned away: 2 sin(angle / 2).
        motion.turned[link] = std::sqrt(0.5 * (squares[0] + squares[1] + squares[2]));
    }
    double farthest = 0.0;
    for (std::int64_t i = 0; i < slots; ++i) {
        const std::int64_t link = robot.link[i];
        if (motion.moved[link]) motion.way[i] += motion.turned[link] * motion.arm[i];
        farthest = most(farthest, motion.way[i]);
    }
    return farthest;
}

void bend_links(const Robot& robot, const double* angles, Motion& motion) {
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        const Joint& joint = robot.joint[j];
        const std::int64_t link = j + 1, parent = joint.parent;
        const double change = std::fabs(angles[j] - motion.angles[j]);
        const double span = robot.span[j] + (joint.slides ? std::fabs(angles[j]) : 0.0);
        motion.bend[link] = motion.bend[parent] + (joint.slides ? 0.0 : change);
        motion.sway[link] = motion.sway[parent] + motion.bend[parent] * span + (joint.slides ? change : 0.0);
        motion.chain[link] = motion.chain[parent] + span;
    }
}

// For tests: how far each shape (shapes,) may have moved from the angles `then` to `now`, as seen from each link that carries both it and
// another: (shapes, links), by the number of the other link.
MOBEE_CALL void mobee_swung(const Robot* robot, const double* then, const double* now, double* out) {
    Motion motion;
    motion.fit(*robot);
    std::copy(then, then + robot->joints, motion.angles.begin());
    bend_links(*robot, now, motion);
    for (const Cluster cluster : robot->cluster) {
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) {
            const Shape& shape = robot->shape[i];
            for (std::int64_t other = 0; other < robot->links; ++other)
                *out++ = swung(motion, shape.link, robot->common[shape.link * robot->links + other], shape.lever);
        }
    }
}

}  // namespace mobee
