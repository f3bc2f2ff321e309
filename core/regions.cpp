// SPDX-License-Identifier: Apache-2.0
// Regions of a colour in a picture, and their outlines to a fraction of a pixel.
#include <algorithm>
#include <cmath>
#include <cstdint>

#include "array.hpp"
#include "interface.hpp"
#include "vector.hpp"

namespace mobee {

// The arguments from Python, see mobee/_core/vision.py.
struct Coloring {
    const float* likeness;      // (height, width): how much of a colour is in each pixel, 0 for none
    double* points;             // (room, 2), filled: column and row of the outlines' points, one region after the other
    std::int64_t* ends;         // (most,), filled: the number of points up to the end of each region
    std::int64_t* areas;        // (most,), filled: px
    double* hulls;              // (most,), filled: area of the convex hull of each outline
    std::int64_t height, width;
    std::int64_t least, around; // px: area of the smallest region; side of the square in which the colour of a whole pixel is looked up
};

namespace coloring {

struct Box {
    std::int64_t top, bottom, left, right;  // the last row and column are not in it

    std::int64_t height() const { return bottom - top; }
    std::int64_t width() const { return right - left; }
};

struct Region {
    Box box;
    std::int64_t area;
};

// The regions of a mask, by union and find; `number` (height, width): that of each pixel, from 0 in the order of their first pixels, or -1.
struct Labels {
    Array<std::int32_t> number, parent;
    Array<Region> regions;

    std::int32_t root(std::int32_t of) {
        while (parent[of] != of) of = parent[of] = parent[parent[of]];
        return of;
    }

    void join(std::int32_t a, std::int32_t b) {
        a = root(a), b = root(b);
        if (a < b) parent[b] = a;
        if (b < a) parent[a] = b;
    }

    template <class IsIn>
    void find(std::int64_t height, std::int64_t width, bool diagonal, IsIn is_in) {
        number.clear(), parent.clear(), regions.clear();
        number.resize(height * width);
        for (std::int64_t row = 0; row < height; ++row)
            for (std::int64_t column = 0; column < width; ++column) {
                const std::int64_t at = row * width + column;
                number[at] = -1;
                if (!is_in(row, column)) continue;
                const auto connect = [&](bool exists, std::int64_t other) {
                    if (!exists || number[other] < 0) return;
                    if (number[at] < 0) number[at] = number[other];
                    else join(number[at], number[other]);
                };
                connect(column > 0, at - 1);
                connect(row > 0, at - width);
                connect(diagonal && row > 0 && column > 0, at - width - 1);
                connect(diagonal && row > 0 && column + 1 < width, at - width + 1);
                if (number[at] < 0) {
                    number[at] = static_cast<std::int32_t>(parent.size());
                    parent.push(number[at]);
                }
            }
        Array<std::int32_t> names(parent.size());
        for (std::int32_t& name : names) name = -1;
        for (std::int64_t row = 0; row < height; ++row)
            for (std::int64_t column = 0; column < width; ++column) {
                std::int32_t& mine = number[row * width + column];
                if (mine < 0) continue;
                std::int32_t& name = names[root(mine)];
                if (name < 0) {
                    name = static_cast<std::int32_t>(regions.size());
                    regions.push({{row, row + 1, column, column + 1}, 0});
                }
                mine = name;
                Region& region = regions[name];
                region.box.bottom = row + 1;
                region.box.left = std::min(region.box.left, column), region.box.right = std::max(region.box.right, column + 1);
                ++region.area;
            }
    }
};

struct Point {
    double x, y, angle;
};

// The area of the convex hull of points (Andrew's monotone chain).
double hull_area(Array<Point>& points) {
    std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.x < b.x || (a.x == b.x && a.y < b.y); });
    const auto turn = [](const Point& a, const Point& b, const Point& c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); };
    Array<Point> hull;
    for (int side = 0; side < 2; ++side) {
        const std::size_t first = hull.size();
        for (std::size_t k = 0; k < points.size(); ++k) {
            const Point& next = side == 0 ? points[k] : points[points.size() - 1 - k];
            while (hull.size() >= first + 2 && turn(hull[hull.size() - 2], hull[hull.size() - 1], next) <= 0.0) hull.shorten(hull.size() - 1);
            hull.push(next);
        }
        hull.shorten(hull.size() - 1);
    }
    double twice = 0.0;
    for (std::size_t k = 0; k < hull.size(); ++k) {
        const Point &a = hull[k], &b = hull[(k + 1) % hull.size()];
        twice += (a.x - hull[0].x) * (b.y - hull[0].y) - (a.y - hull[0].y) * (b.x - hull[0].x);
    }
    return 0.5 * twice;
}

struct Finder {
    const Coloring& coloring;
    Labels rough, parts, holes;
    Array<float> own, share;  // of the window of a region: its likeness, and how much of each pixel is of its colour
    Array<Point> points;
    std::int64_t count = 0, written = 0;

    // Fill `share` in the window around a rough region.
    void find_shares(std::int32_t region, const Box& window) {
        const std::int64_t height = window.height(), width = window.width(), reach = coloring.around / 2;
        own.clear(), share.clear();
        own.resize(height * width), share.resize(height * width);
        Array<float> along(height * width);  // the largest of each row's stretch
        for (std::int64_t row = 0; row < height; ++row) {
            for (std::int64_t column = 0; column < width; ++column) {
                const std::int64_t at = (window.top + row) * coloring.width + window.left + column;
                own[row * width + column] = rough.number[at] == region ? coloring.likeness[at] : 0.0F;
            }
            for (std::int64_t column = 0; column < width; ++column) {
                float most = 1.0F;
                for (std::int64_t k = std::max<std::int64_t>(0, column - reach); k < std::min(width, column + reach + 1); ++k)
                    most = std::max(most, own[row * width + k]);
                along[row * width + column] = most;
            }
        }
        for (std::int64_t row = 0; row < height; ++row)
            for (std::int64_t column = 0; column < width; ++column) {
                float most = 1.0F;
                for (std::int64_t k = std::max<std::int64_t>(0, row - reach); k < std::min(height, row + reach + 1); ++k)
                    most = std::max(most, along[k * width + column]);
                share[row * width + column] = std::min(own[row * width + column] / most, 1.0F);
            }
    }

    // Write the outline of a part of the window, its holes filled.
    void put_outline(std::int32_t part, const Box& window) {
        const std::int64_t height = window.height(), width = window.width(), wide = width + 2;
        holes.find(height + 2, wide, false, [&](std::int64_t row, std::int64_t column) {
            return row < 1 || column < 1 || row > height || column > width || parts.number[(row - 1) * width + column - 1] != part;
        });
        const auto is_in = [&](std::int64_t row, std::int64_t column) { return holes.number[(row + 1) * wide + column + 1] != 0; };
        points.clear();
        std::int64_t area = 0;
        Point sum{};
        for (const auto& [down, right] : {std::pair<int, int>{0, 1}, {0, -1}, {1, 0}, {-1, 0}})
            for (std::int64_t row = 0; row < height; ++row)
                for (std::int64_t column = 0; column < width; ++column) {
                    if (!is_in(row, column)) continue;
                    area += right == 1 ? 1 : 0;
                    const std::int64_t next_row = row + down, next_column = column + right;
                    if (is_in(next_row, next_column)) continue;
                    const bool has_next = next_row >= 0 && next_row < height && next_column >= 0 && next_column < width;
                    const float next = has_next ? share[next_row * width + next_column] : 0.0F;
                    const double covered = share[row * width + column] + next - 0.5F;
                    points.push({static_cast<double>(column) + right * covered, static_cast<double>(row) + down * covered, 0.0});
                    sum.x += points[points.size() - 1].x, sum.y += points[points.size() - 1].y;
                }
        const double number = static_cast<double>(points.size());
        for (Point& point : points) point.angle = std::atan2(point.y - sum.y / number, point.x - sum.x / number);
        std::sort(points.begin(), points.end(), [](const Point& a, const Point& b) { return a.angle < b.angle; });
        for (const Point& point : points) {
            coloring.points[2 * written] = point.x + static_cast<double>(window.left);
            coloring.points[2 * written++ + 1] = point.y + static_cast<double>(window.top);
        }
        coloring.ends[count] = written, coloring.areas[count] = area, coloring.hulls[count++] = hull_area(points);
    }

    void run() {
        const Coloring& all = coloring;
        rough.find(all.height, all.width, true, [&](std::int64_t row, std::int64_t column) { return all.likeness[row * all.width + column] > 0; });
        for (std::int32_t region = 0; region < static_cast<std::int32_t>(rough.regions.size()); ++region) {
            const Box& box = rough.regions[region].box;
            if (rough.regions[region].area < all.least) continue;
            const Box window{std::max<std::int64_t>(0, box.top - 1), std::min(all.height, box.bottom + 1),
                             std::max<std::int64_t>(0, box.left - 1), std::min(all.width, box.right + 1)};
            find_shares(region, window);
            parts.find(window.height(), window.width(), false,
                       [&](std::int64_t row, std::int64_t column) { return share[row * window.width() + column] >= 0.5F; });
            for (std::int32_t part = 0; part < static_cast<std::int32_t>(parts.regions.size()); ++part)
                if (parts.regions[part].area >= all.least) put_outline(part, window);
        }
    }
};

}  // namespace coloring

// Find the regions of a colour and their outlines, each around its middle; returns their number.
MOBEE_CALL std::int64_t mobee_regions(const Coloring* given) {
    coloring::Finder finder{*given, {}, {}, {}, {}, {}, {}, 0, 0};
    finder.run();
    return finder.count;
}

}  // namespace mobee
