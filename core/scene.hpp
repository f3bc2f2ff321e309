// SPDX-License-Identifier: Apache-2.0
// A robot among the free objects of one state of the world.  It never changes.
#pragma once

#include <cstdint>

#include "placed.hpp"
#include "robot.hpp"

namespace mobee {

// The links that targets do not repel: all volumes of `link` and of the links it carries, the fields of `fields` and of those it carries.
struct Hand {
    std::int64_t link = -1, fields = -1;
};

constexpr int most_hands = 2;

struct Hands {
    Hand hand[most_hands];
};

// The objects sorted into the cells of a grid, with x running fastest.  Large objects (a table) come first and are in no cell.
struct Grid {
    std::int64_t large = 0;
    std::int64_t cells[3] = {0, 0, 0};
    double corner[3] = {0.0, 0.0, 0.0};
    double per_metre = 0.0;
    double widest = 0.0;         // the largest radius in the grid
    Array<std::int64_t> starts;  // (cells + 1,): first object of each cell
};

struct Scene {
    const Robot* robot = nullptr;
    Grid grid;
    Array<Volume> volume;         // (objects,), in the order of the grid
    Array<Outline> outline;       // (objects,)
    Array<Box> box;               // (objects,)
    Array<bool> thick;            // (objects,): no boxes, see `Outline`
    Array<float> x, y, z, bound;  // (objects + lanes,): their balls, as columns; the last `lanes` entries are meaningless
    Array<std::int64_t> name;     // (objects,): index of each in the world
    Array<bool> target;           // (objects,)
    Array<std::int64_t> carried;  // indices of the world's objects that the robot carries

    std::int64_t objects() const { return static_cast<std::int64_t>(volume.size()); }
};

// Return whether a link is the carrier or is mounted on it.
bool carried_by(const Robot& robot, std::int64_t link, std::int64_t carrier);

// Return whether a shape belongs to a reaching hand, so that its contacts with targets are ignored.
bool ignores_targets(const Robot& robot, const Shape& shape, const Hands& hands);

// Return the first cell that overlaps [offset - along, offset + along], and the one after the last; points outside count to the edge cells.
struct Span {
    std::int64_t first, end;
};

Span span(double offset, double along, double per_metre, std::int64_t cells);

}  // namespace mobee
