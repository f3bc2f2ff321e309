// SPDX-License-Identifier: Apache-2.0
#include "interface.hpp"

#ifndef MOBEE_SOURCES
#define MOBEE_SOURCES "unknown"
#endif

// How Python sees that a library and the functions it declares belong together.
MOBEE_CALL std::int64_t mobee_abi() { return mobee::abi; }

// The hash of the sources, see core/build.py, which looks for it in the file too.
MOBEE_CALL const char* mobee_sources() { return "mobee sources " MOBEE_SOURCES; }
