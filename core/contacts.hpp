// SPDX-License-Identifier: Apache-2.0
// Finds the contacts of one pose among the pairs that may touch, and projects them to the motors.
#pragma once

#include <cstdint>

#include "contact.hpp"
#include "pairs.hpp"
#include "scene.hpp"

namespace mobee {

// Forces on a link: their sum, and the sum of their moments about the origin.
struct Wrench {
    Vec3 force, moment;
};

// Buffers of `project`: of the links, and of the motors; all 0 between two calls.
struct Pushes {
    Array<Wrench> wrench;
    Array<double> change;

    void fit(const Robot& robot) {
        wrench.resize(robot.links);
        change.resize(robot.motors);
    }
};

// The depth by which a pair overlaps, see `overlap`.
double overlap_of(const Scene& scene, Placed& placed, Pair pair, Touch& touch);

// Fill a contact; false if it is a contact of a target with a reaching hand, which is ignored.
bool name_contact(const Scene& scene, const Hands& hands, Pair pair, double depth, const Touch& touch, Contact& contact);

// Append a contact to `found` for every pair that overlaps.
void find_contacts(const Scene& scene, const Hands& hands, Placed& placed, const Array<Pair>& pairs, Array<Contact>& found);

// The contacts of a pose, and buffers for sorting them.
struct Contacts {
    Array<Contact> found;
    Array<Contact> unsorted;
    Array<std::int32_t> starts, ends;  // of those of one kind and first shape
};

// Sort contacts by kind, first and second.
void sort_contacts(const Scene& scene, Contacts& contacts);

// Add the sum of J^T (depth * normal) over the contacts of fields (thesis eq. 5.11) to `torque` (motors,); of a robot with a least lever
// that of lever^2 J^T / (|J|^2 + least_lever^2) (depth * normal).
//
// `cut`: a contact acts only on the motors of its own part, as in the original program.
void project(const Robot& robot, const Frame* frames, const Array<Contact>& contacts, bool cut, Pushes& pushes, double* torque);

}  // namespace mobee
