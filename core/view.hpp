// Numbers that somebody else owns: what Python passes.
#pragma once

#include <cstdint>

namespace mobee {

template <class T>
struct View {
    T* data = nullptr;
    std::int64_t size = 0;

    T& operator[](std::int64_t i) const { return data[i]; }
    T* begin() const { return data; }
    T* end() const { return data + size; }
};

struct Interval {
    std::int64_t first = 0, end = 0;
};

}  // namespace mobee
