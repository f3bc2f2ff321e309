// SPDX-License-Identifier: Apache-2.0
#include "contacts.hpp"

#include <algorithm>

namespace mobee {

namespace contacts {

// Return the name of a contact's shape: indices below `slots` are the robot's shapes, the others are objects of the snapshot.
std::int64_t name_of(const Scene& scene, const Shape& shape) {
    const std::int64_t own = scene.robot->own_shapes;
    return shape.name < own ? shape.name : own + scene.carried[shape.name - own];
}

bool before(const Contact& a, const Contact& b) {
    if (a.kind != b.kind) return a.kind < b.kind;
    return a.first != b.first ? a.first < b.first : a.second < b.second;
}

void push(Wrench& wrench, Vec3 force, Vec3 point) {
    wrench.force = wrench.force + force;
    wrench.moment = wrench.moment + cross(point, force);
}

bool is_zero(Vec3 v) { return v.x == 0.0 && v.y == 0.0 && v.z == 0.0; }

// The sum over the motors of the squared changes of a contact's depth when each moves by the angle 1 of the law [m^2]; only the joints
// count that move one of the two links.  `change` (motors,): all 0 before and after.
double squared_lever(const Robot& robot, const Frame* frames, const Contact& contact, Array<double>& change) {
    const std::int64_t sides[] = {contact.first_link, contact.second_link};
    const std::int64_t common = contact.second_link < 0 ? 0 : robot.common[sides[0] * robot.links + sides[1]];
    double sign = 1.0, squares = 0.0;
    for (const std::int64_t side : sides) {
        for (std::int64_t link = side; link > common; link = robot.joint[link - 1].parent) {
            const Joint& joint = robot.joint[link - 1];
            const Vec3 axis = turn(frames[link], joint.axis), arm = contact.touch.point - move(frames[link], joint.point);
            const double along = sign * dot(joint.slides ? axis : cross(axis, arm), contact.touch.normal);
            for (std::int64_t k = link - 1; k < robot.drives * robot.joints; k += robot.joints) {
                double& of_motor = change[robot.motor[k]];
                const double more = robot.travel[k] * along;
                squares += more * (2.0 * of_motor + more);
                of_motor += more;
            }
        }
        sign = -1.0;
    }
    for (const std::int64_t side : sides) {
        for (std::int64_t link = side; link > common; link = robot.joint[link - 1].parent) {
            for (std::int64_t k = link - 1; k < robot.drives * robot.joints; k += robot.joints) change[robot.motor[k]] = 0.0;
        }
    }
    return squares;
}

constexpr double lever = 0.5;  // m, of the contacts for which the default gain was tuned; `LEVER` of mobee/robot/robot.py

// The share of a contact in the depth of all contacts of fields between the same two links; all free objects count as one link.
double share_of(const Array<Contact>& contacts, const Contact& contact) {
    double total = 0.0;
    for (const Contact& other : contacts) {
        const bool same = other.first_link == contact.first_link && other.second_link == contact.second_link;
        const bool mirrored = other.first_link == contact.second_link && other.second_link == contact.first_link;
        if (other.kind == field_contact && (same || mirrored)) total += other.depth;
    }
    return contact.depth / total;
}

// The force of a contact of fields: depth * normal.  With a least lever it makes a push by J^T the damped inverse of J, times lever^2, and
// the contacts of two links together push as one.
Vec3 push_of(const Robot& robot, const Frame* frames, const Array<Contact>& contacts, const Contact& contact, Array<double>& change) {
    const Vec3 force = contact.depth * contact.touch.normal;
    if (robot.least_lever <= 0.0) return force;
    const double squares = squared_lever(robot, frames, contact, change) + robot.least_lever * robot.least_lever;
    return share_of(contacts, contact) * lever * lever / squares * force;
}

// Sum in the order of the contacts, so that the result does not depend on the order in which they were found.
bool push_links(const Robot& robot, const Frame* frames, const Array<Contact>& contacts, Pushes& pushes) {
    bool any = false;
    for (const Contact& contact : contacts) {
        if (contact.kind != field_contact) continue;
        any = true;
        const Vec3 force = push_of(robot, frames, contacts, contact, pushes.change);
        push(pushes.wrench[contact.first_link], force, contact.touch.point);
        if (contact.second_link >= 0) push(pushes.wrench[contact.second_link], -force, contact.touch.point);
    }
    return any;
}

}  // namespace contacts

double overlap_of(const Scene& scene, Placed& placed, Pair pair, Touch& touch) {
    const Robot& robot = *scene.robot;
    const auto slots = static_cast<std::int32_t>(robot.slots());
    const Volume& one = placed_volume(robot, placed, pair.first);
    const Volume& two = pair.second < slots ? placed_volume(robot, placed, pair.second) : scene.volume[pair.second - slots];
    return overlap(one, two, touch);
}

bool name_contact(const Scene& scene, const Hands& hands, Pair pair, double depth, const Touch& touch, Contact& contact) {
    const Robot& robot = *scene.robot;
    const Shape& one = robot.shape[pair.first];
    contact = {one.field ? field_contact : solid_contact, contacts::name_of(scene, one), 0, one.link, -1, depth, touch};
    if (pair.second >= robot.slots()) {
        const std::int64_t object = pair.second - robot.slots();
        contact.second = robot.own_shapes + scene.name[object];
        return !(scene.target[object] && ignores_targets(robot, one, hands));
    }
    const Shape& two = robot.shape[pair.second];
    if (two.field) contact.kind = field_contact;  // a carried object meets fields too
    contact.second = contacts::name_of(scene, two);
    contact.second_link = two.link;
    if (contact.second < contact.first) {
        std::swap(contact.first, contact.second);
        std::swap(contact.first_link, contact.second_link);
        contact.touch.normal = -touch.normal;
    }
    return true;
}

void find_contacts(const Scene& scene, const Hands& hands, Placed& placed, const Array<Pair>& pairs, Array<Contact>& found) {
    found.clear();
    Touch touch;
    Contact contact;
    for (const Pair pair : pairs) {
        const double depth = overlap_of(scene, placed, pair, touch);
        if (depth > 0.0 && name_contact(scene, hands, pair, depth, touch, contact)) found.push(contact);
    }
}

void sort_contacts(const Scene& scene, Contacts& contacts) {
    constexpr std::size_t few = 16;
    Array<Contact>& found = contacts.found;
    if (found.size() <= few || scene.carried.size() > 0) {
        std::sort(found.begin(), found.end(), contacts::before);
        return;
    }
    // Insertion into the place of its kind and first shape, after the contacts with a smaller second shape.
    const std::int64_t shapes = scene.robot->own_shapes;
    const auto place_of = [shapes](const Contact& one) { return static_cast<std::size_t>(one.kind * shapes + one.first); };
    std::swap(contacts.found, contacts.unsorted);
    found.spare(contacts.unsorted.size());
    found.shorten(contacts.unsorted.size());
    Array<std::int32_t>&starts = contacts.starts, &ends = contacts.ends;
    starts.clear();
    starts.resize(static_cast<std::size_t>(2 * shapes + 1));
    for (const Contact& one : contacts.unsorted) ++starts[place_of(one) + 1];
    for (std::size_t k = 1; k < starts.size(); ++k) starts[k] += starts[k - 1];
    ends.clear();
    std::copy(starts.begin(), starts.end(), ends.spare(starts.size()));
    for (const Contact& one : contacts.unsorted) {
        const std::size_t place = place_of(one);
        std::int32_t at = ends[place]++;
        for (; at > starts[place] && one.second < found[at - 1].second; --at) found[at] = found[at - 1];
        found[at] = one;
    }
}

void project(const Robot& robot, const Frame* frames, const Array<Contact>& found, bool cut, Pushes& pushes, double* torque) {
    if (!contacts::push_links(robot, frames, found, pushes)) return;
    Array<Wrench>& wrench = pushes.wrench;
    // Accumulate over the links from the tips to the base.
    for (std::int64_t link = robot.joints; link > 0; --link) {
        const Vec3 force = wrench[link].force, moment = wrench[link].moment;
        if (contacts::is_zero(force) && contacts::is_zero(moment)) continue;
        wrench[link] = Wrench{};
        const Joint& joint = robot.joint[link - 1];
        // A joint does not move its own axis, so the axis is fixed in the moved link as well.
        const Frame& frame = frames[link];
        const Vec3 axis = turn(frame, joint.axis);
        const double along = joint.slides ? dot(axis, force) : dot(axis, moment - cross(move(frame, joint.point), force));
        for (std::int64_t drive = 0; drive < robot.drives; ++drive) {
            const std::int64_t k = drive * robot.joints + link - 1;
            torque[robot.motor[k]] += robot.scale[k] * along;
        }
        if (cut && joint.border) continue;
        Wrench& carrier = wrench[joint.parent];
        carrier.force = carrier.force + force;
        carrier.moment = carrier.moment + moment;
    }
    wrench[0] = Wrench{};
}

}  // namespace mobee
