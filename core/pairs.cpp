// SPDX-License-Identifier: Apache-2.0
#include "pairs.hpp"

#include <bit>

#include "lanes.hpp"

namespace mobee {

namespace pairs {

// Eight balls as columns.
struct Balls {
    Eight x, y, z, bound;
};

inline Balls balls_at(const float* x, const float* y, const float* z, const float* bound) {
    return {load<Eight>(x), load<Eight>(y), load<Eight>(z), load<Eight>(bound)};
}

// Bit k: whether ball k touches a given ball.
inline unsigned touching(const Ball& ball, const Balls& balls) {
    const Eight d = ball.x - balls.x, e = ball.y - balls.y, f = ball.z - balls.z, r = ball.radius + balls.bound;
    return less(d * d + e * e + f * f, r * r);
}

inline bool touching(const Ball& a, const Ball& b) {
    const float d = a.x - b.x, e = a.y - b.y, f = a.z - b.z, r = a.radius + b.radius;
    return d * d + e * e + f * f < r * r;
}

inline Ball ball_of(const Robot& robot, const Placed& placed, std::int64_t slot, float skin) {
    return {placed.x[slot], placed.y[slot], placed.z[slot], robot.bound[slot] + skin + placed.margin};
}

inline EightInts from_number(std::int64_t first) { return EightInts{0, 1, 2, 3, 4, 5, 6, 7} + static_cast<std::int32_t>(first); }

// A list of pairs to which pairs are being appended.
struct Writer {
    PairList& list;
    std::int32_t *begin, *first, *second;

    Writer(PairList& to, std::int64_t most) : list(to) {
        begin = first = to.first.spare(static_cast<std::size_t>(most + lanes));
        second = to.second.spare(static_cast<std::size_t>(most + lanes));
    }
    ~Writer() {
        list.first.extend(static_cast<std::size_t>(first - begin));
        list.second.extend(static_cast<std::size_t>(first - begin));
    }
    void add(std::int64_t one, EightInts others, unsigned which) {
        const EightInts all = EightInts{} + static_cast<std::int32_t>(one);
        std::memcpy(first, &all, sizeof all);
        std::int32_t* end = put(second, others, which);
        first += end - second;
        second = end;
    }
};

// Append the pairs of some strips.
void look_through(const Robot& robot, const Placed& placed, std::int64_t begin, std::int64_t end, float skin, PairList& list) {
    Writer found(list, (end - begin) * lanes);
    const float *x = placed.x.data(), *y = placed.y.data(), *z = placed.z.data(), *bound = robot.bound.data();
    const float wider = placed.margin + skin;
    const Strip* last = robot.strip.data() + end;
    for (const Strip* strip = robot.strip.data() + begin; strip != last; ++strip) {
        const std::int64_t i = strip->slot, k = strip->start;
        const unsigned near = touching({x[i], y[i], z[i], bound[i] + wider}, balls_at(x + k, y + k, z + k, bound + k));
        found.add(i, from_number(k), near & strip->tested);
    }
}

void own(const Robot& robot, const Placed& placed, float skin, Pairs& pairs) {
    for (const ClusterPair& two : robot.cluster_pair) {
        Ball a = placed.ball[two.first];
        a.radius += skin;
        if (two.first != two.second && !touching(a, placed.ball[two.second])) continue;
        look_through(robot, placed, two.thick, two.others, skin, pairs.thick);
        look_through(robot, placed, two.others, two.end, skin, pairs.others);
    }
}

// A mask of the lanes from `k` to before `end`.
inline unsigned before(std::int64_t k, std::int64_t end) { return end - k < lanes ? (1u << (end - k)) - 1u : 0xffu; }

// Add the objects from `begin` to before `end` that touch a ball.
void scan(const Scene& scene, const Ball& ball, std::int64_t begin, std::int64_t end, Near& near) {
    for (std::int64_t k = begin; k < end; k += lanes) {
        const unsigned which = touching(ball, balls_at(&scene.x[k], &scene.y[k], &scene.z[k], &scene.bound[k])) & before(k, end);
        put(&near.second[near.count], from_number(k), which);
        near.count += std::popcount(which);
    }
}

void fill_columns(const Scene& scene, Near& near) {
    const auto slots = static_cast<std::int32_t>(scene.robot->slots());
    for (std::int64_t k = 0; k < near.count; ++k) {
        const std::int32_t object = near.second[k];
        near.x[k] = scene.x[object];
        near.y[k] = scene.y[object];
        near.z[k] = scene.z[object];
        near.bound[k] = scene.bound[object];
        near.second[k] = slots + object;
    }
}

// Gather the objects that touch a ball: the large ones, then cell by cell.
void gather(const Scene& scene, const Ball& ball, Near& near) {
    const Grid& grid = scene.grid;
    near.count = 0;
    scan(scene, ball, 0, grid.large, near);
    const double along = ball.radius + grid.widest;
    const Span i = span(ball.x - grid.corner[0], along, grid.per_metre, grid.cells[0]);
    const Span j = span(ball.y - grid.corner[1], along, grid.per_metre, grid.cells[1]);
    const Span k = span(ball.z - grid.corner[2], along, grid.per_metre, grid.cells[2]);
    for (std::int64_t layer = k.first; layer < k.end; ++layer) {
        for (std::int64_t row = j.first; row < j.end; ++row) {
            const std::int64_t* cell = grid.starts.data() + (layer * grid.cells[1] + row) * grid.cells[0];
            scan(scene, ball, cell[i.first], cell[i.end], near);
        }
    }
    fill_columns(scene, near);
}

void fit(Near& near, const Scene& scene) {
    for (Array<float>* column : {&near.x, &near.y, &near.z, &near.bound}) column->resize(scene.x.size());
    near.second.resize(scene.x.size());
}

// Sort the pairs with objects into the two lists.
void sort_out(const Scene& scene, const PairList& found, Pairs& pairs) {
    const Robot& robot = *scene.robot;
    const auto slots = static_cast<std::int32_t>(robot.slots());
    const std::size_t count = found.size();
    std::int32_t *thick_first = pairs.thick.first.spare(count), *thick_second = pairs.thick.second.spare(count);
    std::int32_t *other_first = pairs.others.first.spare(count), *other_second = pairs.others.second.spare(count);
    std::size_t both = 0;
    for (std::size_t k = 0; k < count; ++k) {
        thick_first[both] = other_first[k - both] = found.first[k];
        thick_second[both] = other_second[k - both] = found.second[k];
        both += robot.thick[found.first[k]] && scene.thick[found.second[k] - slots];
    }
    pairs.thick.first.extend(both);
    pairs.thick.second.extend(both);
    pairs.others.first.extend(count - both);
    pairs.others.second.extend(count - both);
}

// Append the pairs of shapes and free objects; the objects near a cluster are gathered once for all of its shapes.
void with_world(const Scene& scene, const Placed& placed, float skin, Pairs& pairs) {
    const Robot& robot = *scene.robot;
    Near& near = pairs.near;
    fit(near, scene);
    pairs.with_world.clear();
    for (std::size_t c = 0; c < robot.cluster.size(); ++c) {
        Ball around = placed.ball[c];
        around.radius += skin;
        gather(scene, around, near);
        if (near.count == 0) continue;
        const Cluster cluster = robot.cluster[c];
        Writer found(pairs.with_world, (cluster.end - cluster.first) * near.count);
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) {
            if (!robot.shape[i].meets_world) continue;
            const Ball ball = ball_of(robot, placed, i, skin);
            for (std::int64_t k = 0; k < near.count; k += lanes) {
                const unsigned which = touching(ball, balls_at(&near.x[k], &near.y[k], &near.z[k], &near.bound[k])) & before(k, near.count);
                found.add(i, load<EightInts>(&near.second[k]), which);
            }
        }
    }
    sort_out(scene, pairs.with_world, pairs);
}

}  // namespace pairs

void PairList::clear() {
    first.clear();
    second.clear();
}

void find_pairs(const Scene& scene, const Placed& placed, double skin, Pairs& pairs) {
    const float wide = skin > 0.0 ? roomy(skin) : 0.0f;
    pairs.thick.clear();
    pairs.others.clear();
    pairs::own(*scene.robot, placed, wide, pairs);
    if (scene.objects() > 0) pairs::with_world(scene, placed, wide, pairs);
}

}  // namespace mobee
