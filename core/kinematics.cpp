// SPDX-License-Identifier: Apache-2.0
#include "kinematics.hpp"

#include <cmath>

#include "interface.hpp"
#include "lanes.hpp"

namespace mobee {

namespace kinematics {

constexpr double large = 1e5;  // rad: beyond it `sine_cosine` loses digits

void set_large_ones(const double* angles, std::int64_t count, double* sines, double* cosines) {
    for (std::int64_t j = 0; j < count; ++j) {
        if (std::fabs(angles[j]) < large) continue;
        sines[j] = std::sin(angles[j]);
        cosines[j] = 1.0 - std::cos(angles[j]);
    }
}

}  // namespace kinematics

void Links::fit(const Robot& robot) {
    angles.resize(robot.joints);
    s.resize(robot.joints);
    c.resize(robot.joints);
    frame.resize(robot.links);
    frame[0] = Frame{};
}

void joint_angles(const Robot& robot, const double* q, double* angles) {
    for (std::int64_t j = 0; j < robot.joints; ++j) angles[j] = robot.offset[j];
    for (std::int64_t drive = 0; drive < robot.drives; ++drive) {
        const std::int64_t* motor = robot.motor.data() + drive * robot.joints;
        const double* scale = robot.scale.data() + drive * robot.joints;
        for (std::int64_t j = 0; j < robot.joints; ++j) angles[j] += scale[j] * q[motor[j]];
    }
}

void sines_cosines(const double* angles, std::int64_t count, double* sines, double* cosines) {
    Four sine, cosine, largest{};
    const auto look_at = [&](Four angle) {
        sine_cosine(angle, sine, cosine);
        const Four size = angle < 0.0 ? -angle : angle;
        largest = size < largest ? largest : size;  // NaN, of angles that have overflown, is the largest
    };
    std::int64_t j = 0;
    for (; j + 4 <= count; j += 4) {
        look_at(load<Four>(angles + j));
        std::memcpy(sines + j, &sine, sizeof sine);
        std::memcpy(cosines + j, &cosine, sizeof cosine);
    }
    if (j < count) {
        Four rest{};
        for (std::int64_t k = j; k < count; ++k) rest[k - j] = angles[k];
        look_at(rest);
        for (std::int64_t k = j; k < count; ++k) sines[k] = sine[k - j], cosines[k] = cosine[k - j];
    }
    bool all_small = true;
    for (int k = 0; k < 4; ++k) all_small &= largest[k] < kinematics::large;
    if (!all_small) kinematics::set_large_ones(angles, count, sines, cosines);
}

void place_links(const Robot& robot, const bool* moved, Links& links) {
    sines_cosines(links.angles.data(), robot.joints, links.s.data(), links.c.data());
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        if (moved != nullptr && !moved[j + 1]) continue;
        const Joint& joint = robot.joint[j];
        const Frame& carrier = links.frame[joint.parent];
        Frame& link = links.frame[j + 1];
        const double s = joint.slides ? links.angles[j] : links.s[j], c = joint.slides ? 0.0 : links.c[j];
        const Four x = Four{1.0, 0.0, 0.0, 0.0} + s * joint.S.x + c * joint.C.x;
        const Four y = Four{0.0, 1.0, 0.0, 0.0} + s * joint.S.y + c * joint.C.y;
        const Four z = Four{0.0, 0.0, 1.0, 0.0} + s * joint.S.z + c * joint.C.z;
        const Four shift = s * joint.S.shift + c * joint.C.shift;
        link.x = x[0] * carrier.x + x[1] * carrier.y + x[2] * carrier.z;
        link.y = y[0] * carrier.x + y[1] * carrier.y + y[2] * carrier.z;
        link.z = z[0] * carrier.x + z[1] * carrier.y + z[2] * carrier.z;
        link.shift = shift[0] * carrier.x + shift[1] * carrier.y + shift[2] * carrier.z + carrier.shift;
    }
}

void place_links_at(const Robot& robot, const double* q, Links& links) {
    joint_angles(robot, q, links.angles.data());
    place_links(robot, nullptr, links);
}

void add_jacobian(const Robot& robot, const Frame* frames, std::int64_t link, Vec3 point, double* out) {
    const std::int64_t n = robot.motors;
    for (std::int64_t here = link; here > 0; here = robot.joint[here - 1].parent) {
        const Joint& joint = robot.joint[here - 1];
        // A joint does not move its own axis, so the axis is fixed in the moved link too.
        const Vec3 axis = turn(frames[here], joint.axis);
        const Vec3 linear = joint.slides ? axis : cross(axis, point - move(frames[here], joint.point));
        for (std::int64_t drive = 0; drive < robot.drives; ++drive) {
            const std::int64_t k = drive * robot.joints + here - 1;
            const double scale = robot.scale[k];
            double* column = out + robot.motor[k];
            for (int row = 0; row < 3; ++row) {
                column[row * n] += scale * linear[row];
                if (!joint.slides) column[(3 + row) * n] += scale * axis[row];
            }
        }
    }
}

MOBEE_CALL void mobee_sines_cosines(const double* angles, std::int64_t count, double* sines, double* cosines) {
    sines_cosines(angles, count, sines, cosines);
}

// Fill the frames of all links in the poses q (count, motors): (count, links, 4, 4).
MOBEE_CALL void mobee_link_poses(const Robot* robot, const double* q, std::int64_t count, double* out) {
    Links links;
    links.fit(*robot);
    for (std::int64_t b = 0; b < count; ++b) {
        place_links_at(*robot, q + b * robot->motors, links);
        for (const Frame& frame : links.frame) {
            Four rows[4] = {frame.x, frame.y, frame.z, frame.shift};
            rows[3][3] = 1.0;
            transpose(rows[0], rows[1], rows[2], rows[3]);
            std::memcpy(out, rows, sizeof rows);
            out += 16;
        }
    }
}

// Fill the Jacobians (count, 6, motors) of a link's point (root frame, zero pose) in the poses q (count, motors).
MOBEE_CALL void mobee_jacobians(const Robot* robot, const double* q, std::int64_t count, std::int64_t link, const Vec3* point, double* out) {
    Links links;
    links.fit(*robot);
    for (std::int64_t b = 0; b < count; ++b) {
        place_links_at(*robot, q + b * robot->motors, links);
        double* here = out + b * 6 * robot->motors;
        std::memset(here, 0, 6 * robot->motors * sizeof(double));
        add_jacobian(*robot, links.frame.data(), link, move(links.frame[link], *point), here);
    }
}

}  // namespace mobee
