// SPDX-License-Identifier: Apache-2.0
// Drops most pairs whose balls overlap though the volumes do not.
//
// A pair is dropped only if a separating direction or the exact distance proves it, by a margin; the narrow phase tests the others.
#include <bit>
#include <cmath>

#include "lanes.hpp"
#include "pairs.hpp"

namespace mobee {

namespace sieves {

constexpr double margin = 1e-9;  // m: far above rounding errors, and so small that few pairs more remain
constexpr double tiny = 1e-30;

// The outlines of slots, followed by those of objects.
struct Outlines {
    const Outline *of_slots, *of_objects;
    std::int32_t slots;

    const Outline& operator[](std::int32_t k) const { return k < slots ? of_slots[k] : of_objects[k - slots]; }
};

inline Outlines outlines_of(const Scene& scene, const Placed& placed) {
    return {placed.outline.data(), scene.outline.data(), static_cast<std::int32_t>(scene.robot->slots())};
}

// Four pairs of segments: the vector from the middle of the second to that of the first, both half axes, one over their squares, and the
// sum of the radii of the two volumes.
struct FourPairs {
    Four wx, wy, wz, reach;
    Four ux, uy, uz, per_a;
    Four vx, vy, vz, per_e;
};

inline FourPairs four_pairs(const Outlines& outlines, const std::int32_t* first, const std::int32_t* second) {
    constexpr Four turn{-1.0, -1.0, -1.0, 1.0};
    Four w[4], u[4], v[4];
    for (int k = 0; k < 4; ++k) {
        const Outline &one = outlines.of_slots[first[k]], &two = outlines[second[k]];
        w[k] = one.center + turn * two.center;
        u[k] = one.core;
        v[k] = two.core;
    }
    transpose(w[0], w[1], w[2], w[3]);
    transpose(u[0], u[1], u[2], u[3]);
    transpose(v[0], v[1], v[2], v[3]);
    return {w[0], w[1], w[2], w[3], u[0], u[1], u[2], u[3], v[0], v[1], v[2], v[3]};
}

// Bit k: whether pair k is nearer than the sum of its radii plus the skin; also valid for parallel segments.
inline unsigned near_each_other(const FourPairs& p, double skin) {
    const Four b = p.ux * p.vx + p.uy * p.vy + p.uz * p.vz;
    const Four c = (p.ux * p.wx + p.uy * p.wy + p.uz * p.wz) * p.per_a, f = (p.vx * p.wx + p.vy * p.wy + p.vz * p.wz) * p.per_e;
    const Four b_a = b * p.per_a, b_e = b * p.per_e;
    Four s = unit_of((b_a * f - c) / most_of(1.0 - b_a * b_e, Four{} + tiny));
    const Four t = unit_of(b_e * s + f);
    s = unit_of(b_a * t - c);
    const Four x = p.wx + s * p.ux - t * p.vx, y = p.wy + s * p.uy - t * p.vy, z = p.wz + s * p.uz - t * p.vz;
    const Four reach = p.reach + (skin + margin);
    return less(x * x + y * y + z * z, reach * reach);
}

void thick_ones(const Scene& scene, const Placed& placed, double skin, PairList& pairs, Array<Pair>& left) {
    const std::size_t count = pairs.size();
    std::int32_t *first = pairs.first.data(), *second = pairs.second.data();
    for (std::size_t k = count; k % 4 != 0; ++k) first[k] = second[k] = 0;  // the arrays have space for them
    Pair* to = left.spare(count);
    const Pair* begin = to;
    const Outlines outlines = outlines_of(scene, placed);
    for (std::size_t k = 0; k < count; k += 4) {
        unsigned near = near_each_other(four_pairs(outlines, first + k, second + k), skin);
        if (count - k < 4) near &= (1u << (count - k)) - 1u;
        for (; near != 0; near &= near - 1) {
            const std::size_t which = k + static_cast<std::size_t>(std::countr_zero(near));
            *to++ = {first[which], second[which]};
        }
    }
    left.extend(static_cast<std::size_t>(to - begin));
}

inline Four into(const Box& box, Four v) { return v[0] * box.row[0] + v[1] * box.row[1] + v[2] * box.row[2]; }

// Return whether the segment c - k .. c + k may be nearer than `reach` to a box about the origin, by a test along the box's axes.
inline bool segment_near_box(Four c, Four k, Four half, double reach) {
    const Four none{};
    const Four beyond = most_of(most_of(absolute_of(c) - absolute_of(k), none) - half, none);
    return sum_of_three(beyond * beyond) < reach * reach;
}

// Return whether two boxes are nearer than the skin along the line of their centres.
inline bool boxes_near(Four w, const Box& one, const Box& two, double skin) {
    const Four along = one.half * absolute_of(into(one, w)) + two.half * absolute_of(into(two, w));
    const double square = sum_of_three(w * w);
    return square - margin < sum_of_three(along) + skin * std::sqrt(square);
}

void others(const Scene& scene, Placed& placed, double skin, const PairList& pairs, Array<Pair>& left) {
    const Robot& robot = *scene.robot;
    const auto slots = static_cast<std::int32_t>(robot.slots());
    const auto box_at = [&](std::int32_t slot) -> const Box& {
        if (slot >= slots) return scene.box[slot - slots];
        placed_volume(robot, placed, slot);
        return placed.box[slot];
    };
    const auto thick_at = [&](std::int32_t slot) { return is_thick(slot < slots ? robot.shape[slot].volume.kind : scene.volume[slot - slots].kind); };
    const Outlines outlines = outlines_of(scene, placed);
    Pair* to = left.spare(pairs.size());
    const Pair* begin = to;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
        std::int32_t a = pairs.first[k], b = pairs.second[k];
        if (thick_at(b)) std::swap(a, b);
        const Outline &one = outlines[a], &two = outlines[b];
        const Box& box = box_at(b);
        const Four w = with_fourth(one.center - two.center, Four{});
        const bool near = thick_at(a) ? segment_near_box(into(box, w), into(box, one.core), box.half, one.center[3] + margin + skin)
                                      : boxes_near(w, box_at(a), box, skin);
        *to = {pairs.first[k], pairs.second[k]};
        to += near;
    }
    left.extend(static_cast<std::size_t>(to - begin));
}

}  // namespace sieves

void sieve(const Scene& scene, Placed& placed, double skin, Pairs& pairs) {
    pairs.left.clear();
    sieves::thick_ones(scene, placed, skin, pairs.thick, pairs.left);
    sieves::others(scene, placed, skin, pairs.others, pairs.left);
}

}  // namespace mobee
