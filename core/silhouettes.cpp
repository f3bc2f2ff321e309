// SPDX-License-Identifier: Apache-2.0
// How far the points of an outline are from the silhouette of a shape, and how this changes with all that is unknown.
#include <cmath>
#include <cstdint>

#include "interface.hpp"
#include "vector.hpp"

namespace mobee {

// The arguments from Python, see mobee/_core/vision.py.  The columns of `slopes` are of: the position, the lengths, the angle about the
// vertical if the shape `turns`, `noises` and `biases` of the cameras, three shifts of the outline in each picture, and two in all of them.
struct Silhouette {
    const double* flat;      // (points, 2): of the outline, in the plane at distance 1 of the camera
    const double* inverse;   // (points, 2, 2): a step in that plane by a step of pixels
    const double* normals;   // (directions, 2): of lines that touch the silhouette
    const double* offsets;   // (directions, 3): where they touch it, from the middle of the shape in the axes of the camera
    const double* farthest;  // (directions,): how far these points are along the normals, in the plane
    const double* noise;     // (6, noises): displacements and turns of this camera
    const double* bias;      // (6, biases)
    const double* errors;    // (noises + biases + 3 * cameras + 2,): the unknowns of the last columns
    double* residual;        // (points,), filled: px, positive outside the silhouette
    double* slopes;          // (points, columns), filled
    std::int64_t points, directions, noises, biases, cameras, number, lengths, turns;
    std::int64_t length_of[3];  // which length each axis of the shape has
    Vec3 origin;                // of the camera
    Rotation view;              // its columns: right, down and ahead of the camera
    Vec3 position;              // of the middle of the shape
    Rotation turn;              // of its axes
    double shift, wider, shift_both;  // px
};

namespace silhouettes {

// The line that a point of the outline is farthest beyond.
std::int64_t nearest_line(const Silhouette& outline, double x, double y, double& distance) {
    std::int64_t found = 0;
    distance = x * outline.normals[0] + y * outline.normals[1] - outline.farthest[0];
    for (std::int64_t k = 1; k < outline.directions; ++k) {
        const double other = x * outline.normals[2 * k] + y * outline.normals[2 * k + 1] - outline.farthest[k];
        if (other > distance) {
            distance = other;
            found = k;
        }
    }
    return found;
}

// Write `by_camera` times the factors of the camera's errors; returns the column after them.
double* put_errors(double* column, const double* factors, std::int64_t count, const double* by_camera) {
    for (std::int64_t k = 0; k < count; ++k) {
        double sum = 0.0;
        for (int row = 0; row < 6; ++row) sum += by_camera[row] * factors[row * count + k];
        *column++ = sum;
    }
    return column;
}

}  // namespace silhouettes

MOBEE_CALL void mobee_silhouette(const Silhouette* given) {
    using namespace silhouettes;
    const Silhouette& outline = *given;
    const std::int64_t errors = outline.noises + outline.biases + 3 * outline.cameras + 2, own = 3 + outline.lengths + outline.turns;
    const double middle = dot(outline.view.column(2), outline.position - outline.origin);
    for (std::int64_t point = 0; point < outline.points; ++point) {
        double distance;
        const std::int64_t line = nearest_line(outline, outline.flat[2 * point], outline.flat[2 * point + 1], distance);
        const double nx = outline.normals[2 * line], ny = outline.normals[2 * line + 1];
        const double* inverse = outline.inverse + 4 * point;
        const double gx = inverse[0] * nx + inverse[2] * ny, gy = inverse[1] * nx + inverse[3] * ny;
        const double scale = std::sqrt(gx * gx + gy * gy), ux = gx / scale, uy = gy / scale;
        const double* at = outline.offsets + 3 * line;
        const Vec3 touched{at[0], at[1], at[2]}, offset = out_of(outline.view, touched);
        const double by = -1.0 / ((middle + touched.z) * scale);
        const Vec3 by_point = out_of(outline.view, {by * nx, by * ny, -by * outline.farthest[line]});

        double* column = outline.slopes + point * (own + errors);
        for (int k = 0; k < 3; ++k) *column++ = by_point[k];
        const Vec3 inside = into(outline.turn, offset), by_inside = into(outline.turn, by_point);
        for (std::int64_t length = 0; length < outline.lengths; ++length) column[length] = 0.0;
        for (int k = 0; k < 3; ++k) column[outline.length_of[k]] += by_inside[k] * inside[k];
        column += outline.lengths;
        if (outline.turns != 0) *column++ = by_point.y * offset.x - by_point.x * offset.y;

        const double* last = column;
        const Vec3 about = cross(outline.position + offset - outline.origin, by_point);
        const double by_camera[6] = {-by_point.x, -by_point.y, -by_point.z, -about.x, -about.y, -about.z};
        column = put_errors(column, outline.noise, outline.noises, by_camera);
        column = put_errors(column, outline.bias, outline.biases, by_camera);
        for (std::int64_t camera = 0; camera < outline.cameras; ++camera) {
            const double mine = camera == outline.number ? 1.0 : 0.0;
            *column++ = mine * outline.shift * ux;
            *column++ = mine * outline.shift * uy;
            *column++ = mine * outline.wider;
        }
        *column++ = outline.shift_both * ux;
        *column++ = outline.shift_both * uy;

        double residual = distance / scale;
        for (std::int64_t k = 0; k < errors; ++k) residual += last[k] * outline.errors[k];
        outline.residual[point] = residual;
    }
}

}  // namespace mobee
