// SPDX-License-Identifier: Apache-2.0
#include "placed.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "interface.hpp"
#include "lanes.hpp"

namespace mobee {

void Placed::fit(const Robot& robot) {
    if (serial == robot.serial) return;
    links.fit(robot);
    const std::size_t slots = robot.shape.size();
    outline = Array<Outline>(robot.outline.data(), slots);
    volume.resize(slots);
    box.resize(slots);
    whole.resize(slots);
    for (Array<float>* column : {&x, &y, &z}) {
        column->resize(slots);
        std::fill(column->begin(), column->end(), 0.0f);
    }
    ball.resize(robot.cluster.size());
    for (std::size_t i = 0; i < slots; ++i) {
        volume[i] = robot.shape[i].volume;
        box[i].half = box_of(volume[i]).half;
        whole[i] = false;
    }
    serial = robot.serial;
}

namespace placing {

constexpr float farthest = 1e15f;  // m: squares of larger numbers overflow in single precision

// Place four slots at once, including the empty slots at the end of a cluster.
void fill_columns(const Robot& robot, Placed& placed) {
    const Outline* outline = placed.outline.data();
    float *x = placed.x.data(), *y = placed.y.data(), *z = placed.z.data();
    for (const Cluster cluster : robot.cluster) {
        for (std::int64_t i = cluster.first; i < cluster.end; i += 4) {
            Four a = outline[i].center, b = outline[i + 1].center, c = outline[i + 2].center, d = outline[i + 3].center;
            transpose(a, b, c, d);
            store_single(x + i, a);
            store_single(y + i, b);
            store_single(z + i, c);
        }
    }
}

Ball ball_about(const Robot& robot, const Placed& placed, Cluster cluster) {
    Four sum{};
    for (std::int64_t i = cluster.first; i < cluster.end; ++i) sum += placed.outline[i].center;
    sum *= 1.0 / static_cast<double>(cluster.end - cluster.first);
    Ball ball{static_cast<float>(sum[0]), static_cast<float>(sum[1]), static_cast<float>(sum[2]), 0.0f};
    Eight radius{};
    for (std::int64_t k = cluster.first; k < cluster.end; k += lanes) {
        const Eight d = load<Eight>(&placed.x[k]) - ball.x, e = load<Eight>(&placed.y[k]) - ball.y, f = load<Eight>(&placed.z[k]) - ball.z;
        radius = most_of(root_of(d * d + e * e + f * f) + load<Eight>(&robot.bound[k]), radius);
    }
    ball.radius = roomy(most_in(radius));
    return ball;
}

}  // namespace placing

void place_shape(const Robot& robot, std::int64_t i, Placed& placed) {
    const Frame& f = placed.links.frame[robot.link[i]];
    const Four own = robot.outline[i].center, core = robot.outline[i].core;
    const Four center = own[0] * f.x + own[1] * f.y + own[2] * f.z + f.shift;
    placed.outline[i].center = with_fourth(center, own);
    if (core[3] > 0.0) placed.outline[i].core = with_fourth(core[0] * f.x + core[1] * f.y + core[2] * f.z, core);
    placed.whole[i] = false;
}

void place(const Robot& robot, Placed& placed) {
    place_links(robot, nullptr, placed.links);
    for (const Cluster cluster : robot.cluster)
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) place_shape(robot, i, placed);
}

void bound_clusters(const Robot& robot, Placed& placed) {
    placing::fill_columns(robot, placed);
    float far = 0.0f;
    for (std::size_t c = 0; c < robot.cluster.size(); ++c) {
        const Ball ball = placed.ball[c] = placing::ball_about(robot, placed, robot.cluster[c]);
        const float here = std::fabs(ball.x) + std::fabs(ball.y) + std::fabs(ball.z) + ball.radius;
        far = here < far ? far : here;  // NaN is the farthest
    }
    placed.margin = roomy(0.0, far);
    if (!(far < placing::farthest)) {
        placed.margin = std::numeric_limits<float>::infinity();  // every pair is near
        for (Array<float>* column : {&placed.x, &placed.y, &placed.z}) std::fill(column->begin(), column->end(), 0.0f);
        for (Ball& ball : placed.ball) ball = Ball{};
    }
    for (Ball& ball : placed.ball) ball.radius += placed.margin;
}

const Volume& placed_volume(const Robot& robot, Placed& placed, std::int64_t slot) {
    Volume& volume = placed.volume[slot];
    if (placed.whole[slot]) return volume;
    const Volume& own = robot.shape[slot].volume;
    const Frame& frame = placed.links.frame[robot.shape[slot].link];
    Four x = turned(frame, own.rotation.column(0)), y = turned(frame, own.rotation.column(1)), z = turned(frame, own.rotation.column(2)), w{};
    transpose(x, y, z, w);
    Box& box = placed.box[slot];
    box.row[0] = x;
    box.row[1] = y;
    box.row[2] = z;
    for (int row = 0; row < 3; ++row)
        for (int column = 0; column < 3; ++column) volume.rotation.m[3 * row + column] = box.row[row][column];
    volume.center = three(placed.outline[slot].center);
    volume.core = three(placed.outline[slot].core);
    placed.whole[slot] = true;
    return volume;
}

// For tests: all shapes at q (motors,), in the order of clusters.
MOBEE_CALL void mobee_place(const Robot* robot, const double* q, Volume* out) {
    Placed placed;
    placed.fit(*robot);
    joint_angles(*robot, q, placed.links.angles.data());
    place(*robot, placed);
    for (const Cluster cluster : robot->cluster)
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) *out++ = placed_volume(*robot, placed, i);
}

}  // namespace mobee
