// SPDX-License-Identifier: Apache-2.0
// The C interface, which Python calls through ctypes.
//
// Every function has C linkage and the prefix mobee_.  Arguments and results are numbers, pointers to contiguous arrays of doubles and
// 64-bit integers, and handles of objects that a function mobee_..._new makes and mobee_..._free destroys.  The caller must check
// shapes and types (mobee/_core): the functions do not.
#pragma once

#include <cstdint>

#define MOBEE_CALL extern "C" __attribute__((visibility("default")))

namespace mobee {

// Increase it, and ABI in mobee/_core/__init__.py, when the arguments or the meaning of a function change.
constexpr std::int64_t abi = 4;

}  // namespace mobee
