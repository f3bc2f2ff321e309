// SPDX-License-Identifier: Apache-2.0
#include "scene.hpp"

#include <cmath>
#include <limits>

#include "interface.hpp"
#include "lanes.hpp"

namespace mobee {

// A snapshot of the world in Python's layout, see mobee/model/engine.py.  Everything except the robot is copied.
struct WorldTables {
    std::int64_t objects, carried, side;  // side: number of grid cells along the longest side
    const VolumeRow* volume;              // (objects,)
    const std::int64_t* role;             // (objects,)
    const std::int64_t* which;            // (carried,)
};

namespace scenes {

constexpr std::int64_t obstacle = 0, target = 1;
constexpr double infinity = std::numeric_limits<double>::infinity();

bool is_free(std::int64_t role) { return role == obstacle || role == target; }

// The bounding box of the objects in the grid, without the large ones, and the largest radius among them.
struct Small {
    double usual = 0.0;  // m; an object with a larger radius is large
    Vec3 low{infinity, infinity, infinity}, high{-infinity, -infinity, -infinity};
    double widest = 0.0;
    std::int64_t count = 0;
};

Small small_ones(const WorldTables& from) {
    Small small;
    double total = 0.0;
    std::int64_t number = 0;
    for (std::int64_t i = 0; i < from.objects; ++i) {
        if (!is_free(from.role[i])) continue;
        ++number;
        total += from.volume[i].bound;
    }
    small.usual = 3.0 * total / static_cast<double>(number > 0 ? number : 1);
    for (std::int64_t i = 0; i < from.objects; ++i) {
        const VolumeRow& row = from.volume[i];
        if (!is_free(from.role[i]) || row.bound > small.usual) continue;
        ++small.count;
        small.widest = most(small.widest, row.bound);
        for (int axis = 0; axis < 3; ++axis) {
            small.low[axis] = least(small.low[axis], row.position[axis]);
            small.high[axis] = most(small.high[axis], row.position[axis]);
        }
    }
    return small;
}

void set_grid(Grid& grid, const Small& small, std::int64_t side) {
    const Vec3 low = small.count > 0 ? small.low : Vec3{}, high = small.count > 0 ? small.high : Vec3{1.0, 1.0, 1.0};
    const Vec3 size = high - low;
    const double longest = most(most(size.x, size.y), size.z);
    const double edge = longest > 0.0 ? longest / static_cast<double>(side) : 1.0;
    grid.widest = small.widest;
    grid.per_metre = 1.0 / edge;
    std::size_t cells = 1;
    for (int axis = 0; axis < 3; ++axis) {
        const double number = std::ceil(size[axis] / edge);
        grid.corner[axis] = low[axis];
        grid.cells[axis] = static_cast<std::int64_t>(clamp(number, 1.0, static_cast<double>(side)));
        cells *= static_cast<std::size_t>(grid.cells[axis]);
    }
    grid.starts.resize(cells + 1);
}

std::int64_t cell_of(const Grid& grid, Vec3 center) {
    std::int64_t number = 0;
    for (int axis = 2; axis >= 0; --axis) {
        const Span here = span(center[axis] - grid.corner[axis], 0.0, grid.per_metre, grid.cells[axis]);
        number = number * grid.cells[axis] + here.first;
    }
    return number;
}

// Convert to single precision, clipped so that squares do not overflow; no nearby object is that far away.
float single(double place) { return static_cast<float>(clamp(place, -1e15, 1e15)); }

void put(Scene& scene, const WorldTables& from, std::int64_t which, std::int64_t place) {
    const Volume volume = volume_of(from.volume[which], *scene.robot);
    scene.volume[place] = volume;
    scene.outline[place] = outline_of(volume);
    scene.box[place] = box_of(volume);
    scene.thick[place] = is_thick(volume.kind);
    const Vec3 c = volume.center;
    scene.x[place] = single(c.x);
    scene.y[place] = single(c.y);
    scene.z[place] = single(c.z);
    scene.bound[place] = roomy(volume.bound, most(most(std::fabs(single(c.x)), std::fabs(single(c.y))), std::fabs(single(c.z))));
    scene.name[place] = which;
    scene.target[place] = from.role[which] == target;
}

// Sort the objects by cell (counting sort); large objects come before all cells.
void sort_objects(Scene& scene, const WorldTables& from, double usual) {
    constexpr std::int64_t large = -1, absent = -2;
    Grid& grid = scene.grid;
    Array<std::int64_t> home(from.objects);
    std::int64_t number = 0;
    for (std::int64_t i = 0; i < from.objects; ++i) {
        const VolumeRow& row = from.volume[i];
        home[i] = !is_free(from.role[i]) ? absent : row.bound > usual ? large : cell_of(grid, row.position);
        number += home[i] != absent;
        grid.large += home[i] == large;
        if (home[i] >= 0) ++grid.starts[home[i] + 1];
    }
    grid.starts[0] = grid.large;
    for (std::size_t c = 1; c < grid.starts.size(); ++c) grid.starts[c] += grid.starts[c - 1];
    scene.volume.resize(number);
    scene.outline.resize(number);
    scene.box.resize(number);
    scene.thick.resize(number);
    for (Array<float>* column : {&scene.x, &scene.y, &scene.z, &scene.bound}) column->resize(number + lanes);
    scene.name.resize(number);
    scene.target.resize(number);
    Array<std::int64_t> next(grid.starts.data(), grid.starts.size());
    std::int64_t next_large = 0;
    for (std::int64_t i = 0; i < from.objects; ++i) {
        if (home[i] != absent) put(scene, from, i, home[i] == large ? next_large++ : next[home[i]]++);
    }
}

}  // namespace scenes

bool carried_by(const Robot& robot, std::int64_t link, std::int64_t carrier) {
    while (link > carrier && link > 0) link = robot.joint[link - 1].parent;
    return link == carrier;
}

bool ignores_targets(const Robot& robot, const Shape& shape, const Hands& hands) {
    for (const Hand& hand : hands.hand) {
        if (hand.link < 0) continue;
        if (carried_by(robot, shape.link, hand.link) || (shape.field && carried_by(robot, shape.link, hand.fields))) return true;
    }
    return false;
}

Span span(double offset, double along, double per_metre, std::int64_t cells) {
    const double last = static_cast<double>(cells) - 1.0;
    // With the arguments in this order, NaN (from an overflow) results in a valid cell too.
    const double low = most((offset - along) * per_metre, 0.0), high = most((offset + along) * per_metre, 0.0);
    return {static_cast<std::int64_t>(least(low, last)), static_cast<std::int64_t>(least(high, last)) + 1};
}

MOBEE_CALL Scene* mobee_scene_new(const Robot* robot, const WorldTables* from) {
    Scene* scene = make<Scene>();
    scene->robot = robot;
    const scenes::Small small = scenes::small_ones(*from);
    scenes::set_grid(scene->grid, small, from->side);
    scenes::sort_objects(*scene, *from, small.usual);
    scene->carried = Array<std::int64_t>(from->which, from->carried);
    return scene;
}

MOBEE_CALL void mobee_scene_free(Scene* scene) { discard(scene); }

// For tests: the number of objects, the number of large ones, and the number of cells along x, y and z.
MOBEE_CALL void mobee_scene_counts(const Scene* scene, std::int64_t* counts) {
    const Grid& grid = scene->grid;
    counts[0] = scene->objects();
    counts[1] = grid.large;
    for (int axis = 0; axis < 3; ++axis) counts[2 + axis] = grid.cells[axis];
}

// For tests: the first object of each cell (cells + 1,); the index of each object and whether it is a target, (objects, 2); its centre.
MOBEE_CALL void mobee_scene_objects(const Scene* scene, std::int64_t* starts, std::int64_t* objects, Vec3* centers) {
    for (const std::int64_t start : scene->grid.starts) *starts++ = start;
    for (std::int64_t k = 0; k < scene->objects(); ++k) {
        objects[2 * k] = scene->name[k];
        objects[2 * k + 1] = scene->target[k];
        centers[k] = scene->volume[k].center;
    }
}

MOBEE_CALL void mobee_span(double offset, double along, double per_metre, std::int64_t cells, std::int64_t* out) {
    const Span found = span(offset, along, per_metre, cells);
    out[0] = found.first;
    out[1] = found.end;
}

}  // namespace mobee
