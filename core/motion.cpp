#include "motion.hpp"

#include <algorithm>
#include <cmath>

#include "interface.hpp"

namespace mobee {

namespace motion {

constexpr std::int64_t most_groups = 4;  // of a link

// Call the function with every slot that holds a shape.
template <class Function>
void each_slot(const Robot& robot, Function function) {
    for (const Cluster cluster : robot.cluster)
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) function(i);
}

// Give the shapes of a link to groups, by where they are along the longest side of the box that holds their centres.
void group_link(const Robot& robot, std::int64_t link, Motion& to) {
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

void Motion::fit(const Robot& robot) {
    const std::int64_t slots = robot.slots();
    moved.resize(robot.links);
    moved_in.resize(robot.links);
    for (Array<std::int64_t>* of_slots : {&placed_in, &group_of}) of_slots->resize(slots);
    for (Array<double>* of_joints : {&last, &angles}) of_joints->resize(robot.joints);
    for (Array<double>* of_links : {&turned, &bend, &sway, &chain}) of_links->resize(robot.links);
    for (Array<double>* of_slots : {&arm, &way}) of_slots->resize(slots);
    frame.resize(robot.links);
    if (serial == robot.serial) return;
    serial = robot.serial;
    center.resize(slots);
    make_groups(robot);
}

void Motion::make_groups(const Robot& robot) {
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

void find_moved(const Robot& robot, const double* angles, bool fresh, Motion& motion) {
    ++motion.pose;
    motion.moved[0] = fresh;
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        motion.moved[j + 1] = motion.moved[robot.joint[j].parent] || angles[j] != motion.last[j];
        motion.last[j] = angles[j];
    }
    for (std::int64_t link = 0; link < robot.links; ++link)
        if (motion.moved[link]) motion.moved_in[link] = motion.pose;
}

void remember(const Placed& placed, Motion& motion) {
    const auto copy = [](const auto& from, auto& to) { std::copy(from.begin(), from.begin() + to.size(), to.begin()); };
    copy(placed.links.angles, motion.angles);
    copy(placed.links.frame, motion.frame);
    for (std::size_t i = 0; i < placed.outline.size(); ++i) motion.center[i] = placed.outline[i].center;
    std::fill(motion.way.begin(), motion.way.end(), 0.0);
    for (Group& one : motion.group) one.then = move(motion.frame[one.link], one.middle);
    std::fill(motion.far.begin(), motion.far.end(), 0.0);
}

double measure_groups(const Robot& robot, const Links& links, Motion& motion) {
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

double way_of(const Robot& robot, std::int64_t i, Placed& placed, Motion& motion) {
    const std::int64_t link = robot.link[i];
    if (motion.placed_in[i] >= motion.moved_in[link]) return motion.way[i];
    place_shape(robot, i, placed);
    motion.placed_in[i] = motion.pose;
    motion.way[i] = length(three(placed.outline[i].center - motion.center[i])) + motion.turned[link] * motion.arm[i];
    return motion.way[i];
}

double measure_shapes(const Robot& robot, Placed& placed, Motion& motion) {
    double farthest = 0.0;
    motion::each_slot(robot, [&](std::int64_t i) { farthest = most(farthest, way_of(robot, i, placed, motion)); });
    return farthest;
}

void place_shapes(const Robot& robot, Placed& placed, Motion& motion) {
    motion::each_slot(robot, [&](std::int64_t i) {
        if (motion.placed_in[i] >= motion.moved_in[robot.link[i]]) return;
        place_shape(robot, i, placed);
        motion.placed_in[i] = motion.pose;
    });
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
