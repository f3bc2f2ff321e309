// SPDX-License-Identifier: Apache-2.0
#include "interface.hpp"

#ifndef MOBEE_SOURCES
#define MOBEE_SOURCES "unknown"
#endif

// Python compares this with the version of its own declarations.
MOBEE_CALL std::int64_t mobee_abi() { return mobee::abi; }

// The hash of the sources, which core/build.py also searches in the file.
MOBEE_CALL const char* mobee_sources() { return "mobee sources " MOBEE_SOURCES; }
