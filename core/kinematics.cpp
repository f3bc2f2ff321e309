#include "kinematics.hpp"

#include <cmath>

namespace mobee {

namespace kinematics {

constexpr double large = 1e5;  // rad: beyond it the reduction below loses digits
constexpr double pi_2_high = 1.5707963267341256, pi_2_middle = 6.077100506303966e-11, pi_2_low = 2.0222662487959506e-21;

// Reduction to a quarter turn (Cody and Waite), then Taylor to 1e-17.
inline void sine_cosine(double angle, double& sine, double& cosine) {
    const double quarter = std::floor(angle * 0.6366197723675814 + 0.5);
    const double x = ((angle - quarter * pi_2_high) - quarter * pi_2_middle) - quarter * pi_2_low;
    const double z = x * x;
    double s = z * (1.6059043836821613e-10 - z * 7.647163731819816e-13);
    s = z * (-1.984126984126984e-04 + z * (2.7557319223985893e-06 - z * 2.505210838544172e-08 + z * s));
    s = x + x * z * (-1.6666666666666666e-01 + z * 8.333333333333333e-03 + z * s);
    double c = z * (2.08767569878681e-09 - z * (1.1470745597729725e-11 - z * 4.779477332387385e-14));
    c = z * (-1.3888888888888889e-03 + z * (2.48015873015873e-05 - z * 2.755731922398589e-07 + z * c));
    c = z * (0.5 - z * (4.1666666666666664e-02 + c));
    const double turn = quarter - 4.0 * std::floor(quarter * 0.25);
    const bool odd = turn == 1.0 || turn == 3.0;
    const double big = odd ? 1.0 - c : s;
    const double small = odd ? s : 1.0 - c;
    sine = turn >= 2.0 ? -big : big;
    cosine = turn == 0.0 ? c : 1.0 - (turn == 1.0 || turn == 2.0 ? -small : small);
}

}  // namespace kinematics

void joint_angles(const Robot& robot, const double* q, double* angles) {
    for (std::int64_t j = 0; j < robot.joints; ++j) angles[j] = robot.offset[j];
    for (std::int64_t drive = 0; drive < robot.drives; ++drive) {
        const std::int64_t* motor = robot.motor.data() + drive * robot.joints;
        const double* scale = robot.scale.data() + drive * robot.joints;
        for (std::int64_t j = 0; j < robot.joints; ++j) angles[j] += scale[j] * q[motor[j]];
    }
}

void sines_cosines(const double* angles, std::int64_t count, double* sines, double* cosines) {
    double largest = 0.0;
    for (std::int64_t j = 0; j < count; ++j) largest = most(largest, std::fabs(angles[j]));
    if (!(largest < kinematics::large)) {
        for (std::int64_t j = 0; j < count; ++j) {
            sines[j] = std::sin(angles[j]);
            cosines[j] = 1.0 - std::cos(angles[j]);
        }
        return;
    }
    for (std::int64_t j = 0; j < count; ++j) kinematics::sine_cosine(angles[j], sines[j], cosines[j]);
}

void place_links(const Robot& robot, const double* angles, const double* sines, const double* cosines, const bool* moved, Frame* links) {
    links[0] = Frame{};
    for (std::int64_t j = 0; j < robot.joints; ++j) {
        if (moved != nullptr && !moved[j + 1]) continue;
        const Joint& joint = robot.joint[j];
        const Frame& carrier = links[joint.parent];
        Frame& link = links[j + 1];
        const double* p = carrier.m;
        Vec3 shift;
        if (joint.slides) {
            link = carrier;
            shift = angles[j] * joint.sine;
        } else {
            const double s = sines[j], c = cosines[j];
            const Vec3 u = s * joint.axis, d = c * joint.diagonal, b = c * joint.beside;
            const double xx = 1.0 + d.x, yy = 1.0 + d.y, zz = 1.0 + d.z;
            for (int row = 0; row < 3; ++row) {
                const double r0 = p[4 * row], r1 = p[4 * row + 1], r2 = p[4 * row + 2];
                link.m[4 * row] = r0 * xx + r1 * (b.x + u.z) + r2 * (b.y - u.y);
                link.m[4 * row + 1] = r0 * (b.x - u.z) + r1 * yy + r2 * (b.z + u.x);
                link.m[4 * row + 2] = r0 * (b.y + u.y) + r1 * (b.z - u.x) + r2 * zz;
            }
            shift = s * joint.sine + c * joint.cosine;
        }
        for (int row = 0; row < 3; ++row)
            link.m[4 * row + 3] = p[4 * row] * shift.x + p[4 * row + 1] * shift.y + p[4 * row + 2] * shift.z + p[4 * row + 3];
    }
}

void add_jacobian(const Robot& robot, const Frame* links, std::int64_t link, Vec3 point, double* out) {
    const std::int64_t n = robot.motors;
    for (std::int64_t here = link; here > 0; here = robot.joint[here - 1].parent) {
        const Joint& joint = robot.joint[here - 1];
        // A joint leaves its own axis where it is, so the link it moves carries the axis too.
        const Vec3 axis = turn(links[here], joint.axis);
        const Vec3 linear = joint.slides ? axis : cross(axis, point - move(links[here], joint.point));
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

}  // namespace mobee
