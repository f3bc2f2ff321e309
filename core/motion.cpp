#include "motion.hpp"

#include <algorithm>
#include <cmath>

#include "interface.hpp"

namespace mobee {

void Motion::fit(const Robot& robot) {
    const std::int64_t shapes = robot.shapes();
    for (Array<std::int64_t>* of_links : {&moved_in, &number}) of_links->resize(robot.links);
    moved.resize(robot.links);
    placed_in.resize(shapes);
    for (Array<double>* of_joints : {&last, &angles}) of_joints->resize(robot.joints);
    for (Array<double>* of_links : {&spread, &turned, &far, &bend, &sway, &chain}) of_links->resize(robot.links);
    for (Array<double>* of_shapes : {&x, &y, &z, &arm, &way}) of_shapes->resize(shapes);
    for (Array<Vec3>* of_links : {&then, &middle}) of_links->resize(robot.links);
    frame.resize(robot.links);
    find_middles(robot);
}

void Motion::find_middles(const Robot& robot) {
    std::fill(number.begin(), number.end(), 0);
    std::fill(middle.begin(), middle.end(), Vec3{});
    std::fill(spread.begin(), spread.end(), 0.0);
    for (const Shape& shape : robot.shape) {
        middle[shape.link] = middle[shape.link] + shape.volume.center;
        ++number[shape.link];
    }
    for (std::int64_t link = 0; link < robot.links; ++link)
        if (number[link] > 0) middle[link] = 1.0 / static_cast<double>(number[link]) * middle[link];
    for (std::int64_t i = 0; i < robot.shapes(); ++i) {
        const Volume& volume = robot.shape[i].volume;
        arm[i] = volume.bound - (volume.kind <= Kind::capsule ? volume.radius : 0.0);
        double& most_spread = spread[robot.shape[i].link];
        most_spread = most(most_spread, length(volume.center - middle[robot.shape[i].link]) + arm[i]);
    }
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
    copy(placed.x, motion.x);
    copy(placed.y, motion.y);
    copy(placed.z, motion.z);
    for (std::size_t link = 0; link < motion.then.size(); ++link) motion.then[link] = move(motion.frame[link], motion.middle[link]);
    std::fill(motion.way.begin(), motion.way.end(), 0.0);
    std::fill(motion.far.begin(), motion.far.end(), 0.0);
}

double measure_links(const Robot& robot, const Links& links, Motion& motion) {
    double farthest = 0.0;
    for (std::int64_t link = 0; link < robot.links; ++link) {
        if (motion.moved[link] && motion.number[link] > 0) {
            const Frame &now = links.frame[link], &before = motion.frame[link];
            const Four x = now.x - before.x, y = now.y - before.y, z = now.z - before.z;
            const Four squares = x * x + y * y + z * z;
            motion.turned[link] = std::sqrt(0.5 * (squares[0] + squares[1] + squares[2]));  // 2 sin(angle / 2)
            const Vec3 way = move(now, motion.middle[link]) - motion.then[link];
            motion.far[link] = length(way) + motion.turned[link] * motion.spread[link];
        }
        farthest = most(farthest, motion.far[link]);
    }
    return farthest;
}

double way_of(const Robot& robot, std::int64_t i, Placed& placed, Motion& motion) {
    const std::int64_t link = robot.shape[i].link;
    if (motion.placed_in[i] >= motion.moved_in[link]) return motion.way[i];
    place_shape(robot, i, placed);
    motion.placed_in[i] = motion.pose;
    const Vec3 way{placed.x[i] - motion.x[i], placed.y[i] - motion.y[i], placed.z[i] - motion.z[i]};
    motion.way[i] = length(way) + motion.turned[link] * motion.arm[i];
    return motion.way[i];
}

double measure_shapes(const Robot& robot, Placed& placed, Motion& motion) {
    double farthest = 0.0;
    for (std::int64_t i = 0; i < robot.shapes(); ++i) farthest = most(farthest, way_of(robot, i, placed, motion));
    return farthest;
}

void place_shapes(const Robot& robot, Placed& placed, Motion& motion) {
    for (std::int64_t i = 0; i < robot.shapes(); ++i) {
        if (motion.placed_in[i] >= motion.moved_in[robot.shape[i].link]) continue;
        place_shape(robot, i, placed);
        motion.placed_in[i] = motion.pose;
    }
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
    for (const Shape& shape : robot->shape) {
        for (std::int64_t other = 0; other < robot->links; ++other)
            *out++ = swung(motion, shape.link, robot->common[shape.link * robot->links + other], shape.lever);
    }
}

}  // namespace mobee
