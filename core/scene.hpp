// SPDX-License-Identifier: Apache-2.0
// A robot among the free objects of one state of the world.  It never changes.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "robot.hpp"

namespace mobee {

// Who does not feel the targets: no volume of a link nor of what it carries, and no field of another nor of what that carries.
struct Hand {
    std::int64_t link = -1, fields = -1;
};

constexpr int most_hands = 2;

struct Hands {
    Hand hand[most_hands];
};

// Where the objects stand: sorted into the cells of a grid, x runs fastest.  Large ones (a table) come first, in no cell.
struct Grid {
    std::int64_t large = 0;
    std::int64_t cells[3] = {0, 0, 0};
    double corner[3] = {0.0, 0.0, 0.0};
    double per_metre = 0.0;
    double widest = 0.0;         // the largest radius in the grid
    Array<std::int64_t> starts;  // (cells + 1,): where each cell begins
};

struct Scene {
    const Robot* robot = nullptr;
    Grid grid;
    Array<Volume> volume;         // (objects,), in the order of the grid
    Array<Outline> outline;       // (objects,)
    Array<Box> box;               // (objects,)
    Array<bool> thick;            // (objects,): no boxes, see `Outline`
    Array<float> x, y, z, bound;  // (objects + lanes,): their balls, as columns; what is behind them means nothing
    Array<std::int64_t> name;     // (objects,): which of the world's objects each is
    Array<bool> target;           // (objects,)
    Array<std::int64_t> carried;  // which of the world's objects the robot carries

    std::int64_t objects() const { return static_cast<std::int64_t>(volume.size()); }
};

// Whether a link is the carrier, or mounted on it.
bool carried_by(const Robot& robot, std::int64_t link, std::int64_t carrier);

// Whether a shape is one of those that reach, which do not feel the targets.
bool ignores_targets(const Robot& robot, const Shape& shape, const Hands& hands);

// The first cell, and the one past the last, that [offset - along, offset + along] reaches; what lies outside counts to the edge cells.
struct Span {
    std::int64_t first, end;
};

Span span(double offset, double along, double per_metre, std::int64_t cells);

}  // namespace mobee
