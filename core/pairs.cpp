#include "pairs.hpp"

namespace mobee {

namespace pairs {

// The robot's own pairs.  Distances are compared in columns without branches, so that the compiler can use vector instructions; only
// rows with a hit are looked through.
void own(const Robot& robot, const Placed& placed, double skin, Array<Pair>& found) {
    const double *x = placed.x.data(), *y = placed.y.data(), *z = placed.z.data();
    const Outline* outline = placed.outline.data();
    for (const ClusterPair& two : robot.cluster_pair) {
        const Ball &a = placed.ball[two.first], &b = placed.ball[two.second];
        const bool same = two.first == two.second;
        const double u = a.x - b.x, v = a.y - b.y, w = a.z - b.z, near = a.radius + b.radius + skin;
        if (!same && u * u + v * v + w * w >= near * near) continue;
        const Cluster rows = robot.cluster[two.first], columns = robot.cluster[two.second];
        for (std::int64_t i = rows.first; i < rows.end; ++i) {
            const double xi = x[i], yi = y[i], zi = z[i], bound = outline[i].bound;
            const double p = xi - b.x, q = yi - b.y, r = zi - b.z, far = b.radius + bound + skin;
            if (!same && p * p + q * q + r * r >= far * far) continue;
            const double* reach = robot.reach.data() + i * robot.shapes();
            const std::int64_t begin = same ? i + 1 : columns.first, end = columns.end;
            Pair* pair = found.spare(static_cast<std::size_t>(end - begin));
            std::size_t count = 0;
            if (skin > 0.0) {
                for (std::int64_t j = begin; j < end; ++j) {
                    const double d = xi - x[j], e = yi - y[j], f = zi - z[j], wide = bound + outline[j].bound + skin;
                    pair[count] = {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j)};
                    count += reach[j] >= 0.0 && d * d + e * e + f * f < wide * wide;
                }
            } else {
                std::int64_t hits = 0;
                for (std::int64_t j = begin; j < end; ++j) {
                    const double d = xi - x[j], e = yi - y[j], f = zi - z[j];
                    hits += d * d + e * e + f * f < reach[j];
                }
                if (hits == 0) continue;
                for (std::int64_t j = begin; j < end; ++j) {  // written in any case and kept or not: guessing a branch wrong costs more
                    const double d = xi - x[j], e = yi - y[j], f = zi - z[j];
                    pair[count] = {static_cast<std::int32_t>(i), static_cast<std::int32_t>(j)};
                    count += d * d + e * e + f * f < reach[j];
                }
            }
            found.extend(count);
        }
    }
}

void scan(const Scene& scene, const Ball& ball, std::int64_t begin, std::int64_t end, Array<Near>& near) {
    const double *x = scene.x.data(), *y = scene.y.data(), *z = scene.z.data(), *bound = scene.bound.data();
    std::int64_t hits = 0;
    for (std::int64_t k = begin; k < end; ++k) {
        const double d = ball.x - x[k], e = ball.y - y[k], f = ball.z - z[k], r = ball.radius + bound[k];
        hits += d * d + e * e + f * f < r * r;
    }
    if (hits == 0) return;
    Near* next = near.spare(static_cast<std::size_t>(end - begin));
    std::size_t count = 0;
    for (std::int64_t k = begin; k < end; ++k) {
        const double d = ball.x - x[k], e = ball.y - y[k], f = ball.z - z[k], r = ball.radius + bound[k];
        next[count] = {x[k], y[k], z[k], bound[k], static_cast<std::int32_t>(k)};
        count += d * d + e * e + f * f < r * r;
    }
    near.extend(count);
}

// Gather the objects that touch a ball: the large ones, then cell by cell.
void gather(const Scene& scene, const Ball& ball, Array<Near>& near) {
    const Grid& grid = scene.grid;
    near.clear();
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
}

// The pairs of a shape and a free object; what is near a cluster is gathered once for all of its shapes.
void with_world(const Scene& scene, const Placed& placed, double skin, Array<Near>& near, Array<Pair>& found) {
    const Robot& robot = *scene.robot;
    const auto shapes = static_cast<std::int32_t>(robot.shapes());
    for (std::size_t c = 0; c < robot.cluster.size(); ++c) {
        Ball ball = placed.ball[c];
        ball.radius += skin;
        gather(scene, ball, near);
        if (near.size() == 0) continue;
        for (std::int64_t i = robot.cluster[c].first; i < robot.cluster[c].end; ++i) {
            if (!robot.shape[i].meets_world) continue;
            const double xi = placed.x[i], yi = placed.y[i], zi = placed.z[i], bound = placed.outline[i].bound + skin;
            Pair* pair = found.spare(near.size());
            std::size_t count = 0;
            for (const Near& one : near) {
                const double d = xi - one.x, e = yi - one.y, f = zi - one.z, r = bound + one.bound;
                pair[count] = {static_cast<std::int32_t>(i), shapes + one.object};
                count += d * d + e * e + f * f < r * r;
            }
            found.extend(count);
        }
    }
}

}  // namespace pairs

void find_pairs(const Scene& scene, const Placed& placed, double skin, Pairs& pairs) {
    pairs.list.clear();
    pairs::own(*scene.robot, placed, skin, pairs.list);
    if (scene.objects() > 0) pairs::with_world(scene, placed, skin, pairs.near, pairs.list);
}

}  // namespace mobee
