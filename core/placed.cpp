#include "placed.hpp"

#include <cmath>

#include "interface.hpp"

namespace mobee {

Outline outline_of(const Volume& volume) {
    return {four(volume.center), four(volume.core), volume.radius, volume.bound, volume.squared, volume.inverse, volume.kind};
}

void Placed::fit(const Robot& robot) {
    if (serial == robot.serial) return;
    links.fit(robot);
    const std::size_t shapes = robot.shape.size();
    outline.resize(shapes);
    volume.resize(shapes);
    whole.resize(shapes);
    for (Array<double>* column : {&x, &y, &z}) column->resize(shapes);
    ball.resize(robot.cluster.size());
    for (std::size_t i = 0; i < shapes; ++i) {
        volume[i] = robot.shape[i].volume;
        outline[i] = outline_of(volume[i]);
        whole[i] = false;
    }
    serial = robot.serial;
}

void place_shape(const Robot& robot, std::int64_t i, Placed& placed) {
    const Shape& shape = robot.shape[i];
    const Frame& frame = placed.links.frame[shape.link];
    Outline& outline = placed.outline[i];
    outline.center = moved(frame, shape.volume.center);
    outline.core = turned(frame, shape.volume.core);
    placed.x[i] = outline.center[0];
    placed.y[i] = outline.center[1];
    placed.z[i] = outline.center[2];
    placed.whole[i] = false;
}

void place(const Robot& robot, Placed& placed) {
    place_links(robot, nullptr, placed.links);
    for (std::int64_t i = 0; i < robot.shapes(); ++i) place_shape(robot, i, placed);
}

void bound_clusters(const Robot& robot, Placed& placed) {
    const double *x = placed.x.data(), *y = placed.y.data(), *z = placed.z.data();
    for (std::size_t c = 0; c < robot.cluster.size(); ++c) {
        const Cluster cluster = robot.cluster[c];
        Ball ball;
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) ball.x += x[i], ball.y += y[i], ball.z += z[i];
        const double share = 1.0 / static_cast<double>(cluster.end - cluster.first);
        ball.x *= share;
        ball.y *= share;
        ball.z *= share;
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) {
            const double d = x[i] - ball.x, e = y[i] - ball.y, f = z[i] - ball.z;
            ball.radius = most(ball.radius, std::sqrt(d * d + e * e + f * f) + placed.outline[i].bound);
        }
        ball.radius = roomy(ball.radius);
        placed.ball[c] = ball;
    }
}

const Volume& placed_volume(const Robot& robot, Placed& placed, std::int64_t i) {
    Volume& volume = placed.volume[i];
    if (placed.whole[i]) return volume;
    const Volume& own = robot.shape[i].volume;
    const Frame& frame = placed.links.frame[robot.shape[i].link];
    volume.center = three(placed.outline[i].center);
    volume.core = three(placed.outline[i].core);
    for (int column = 0; column < 3; ++column) {
        const Vec3 axis = turn(frame, own.rotation.column(column));
        volume.rotation.m[column] = axis.x;
        volume.rotation.m[3 + column] = axis.y;
        volume.rotation.m[6 + column] = axis.z;
    }
    placed.whole[i] = true;
    return volume;
}

// For tests: all shapes (shapes,) at q (motors,), in the order of clusters.
MOBEE_CALL void mobee_place(const Robot* robot, const double* q, Volume* out) {
    Placed placed;
    placed.fit(*robot);
    joint_angles(*robot, q, placed.links.angles.data());
    place(*robot, placed);
    for (std::int64_t i = 0; i < robot->shapes(); ++i) out[i] = placed_volume(*robot, placed, i);
}

}  // namespace mobee
