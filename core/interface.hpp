// SPDX-License-Identifier: Apache-2.0
// The C interface: what Python calls, through ctypes.
//
// Every function has C linkage and the prefix mobee_.  It takes and gives numbers, pointers to contiguous arrays of doubles and
// 64-bit integers, and handles of objects that a function mobee_..._new has made and mobee_..._free ends.  Whoever calls has
// checked shapes and types (mobee/_core): nothing here can be called with anything else.
#pragma once

#include <cstdint>

#define MOBEE_CALL extern "C" __attribute__((visibility("default")))

namespace mobee {

// Raise it when a function changes its arguments or its meaning, and with it ABI in mobee/_core/__init__.py.
constexpr std::int64_t abi = 2;

}  // namespace mobee
