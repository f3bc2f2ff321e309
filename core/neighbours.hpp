// SPDX-License-Identifier: Apache-2.0
// The contacts of poses that follow each other closely, by a list of neighbours (Verlet).
#pragma once

#include <cstdint>

#include "contact.hpp"

namespace mobee {

struct Neighbours;  // the state of one user from pose to pose, of a robot in a scene; mobee/model/engine.py makes it

// Find the contacts in the pose q (motors,), unsorted; returns their number.
std::int64_t find(Neighbours& near, const double* q);

// Sort the contacts of the last `find`, and add the sum of J^T (depth * normal) over the contacts of fields to `torque` (motors,).
void project_contacts(Neighbours& near, double* torque);

// The contacts of the last `find`; after `project_contacts` in order: by kind, first and second.
const Contact& contact(const Neighbours& near, std::int64_t index);

}  // namespace mobee
