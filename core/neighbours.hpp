// SPDX-License-Identifier: Apache-2.0
// The contacts of poses that follow each other closely, by a list of neighbours (Verlet).
#pragma once

#include <cstdint>

#include "contact.hpp"

namespace mobee {

struct Neighbours;  // what one user remembers from pose to pose, of a robot in a scene; mobee/model/track.py makes it

// Find the contacts in the pose q (motors,); returns how many, in no order.
std::int64_t find(Neighbours& near, const double* q);

// Put the contacts of the last `find` in order and add what those of fields do to the motors, the sum of J^T (depth * normal), to
// `torque` (motors,).
void project_contacts(Neighbours& near, double* torque);

// The contacts of the last `find`; after `project_contacts` in order: by kind, first and second.
const Contact& contact(const Neighbours& near, std::int64_t index);

}  // namespace mobee
