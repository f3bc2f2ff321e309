// SPDX-License-Identifier: Apache-2.0
// The contacts of one pose, and their projection to the motors.
#pragma once

#include <cstdint>

#include "volume.hpp"

namespace mobee {

enum ContactKind : std::int64_t { solid_contact = 0, field_contact = 1 };

// Names are indices: of the robot's own shapes, then of the objects of the snapshot.  Link -1 stands for a free object.
struct Contact {
    std::int64_t kind = solid_contact;
    std::int64_t first = 0, second = 0;
    std::int64_t first_link = 0, second_link = -1;
    double depth = 0.0;  // m
    Touch touch;
};

}  // namespace mobee
