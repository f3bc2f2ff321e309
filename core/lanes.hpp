// Eight numbers in one register, or in several where the processor has none so wide: the results are the same bits.
#pragma once

#include <cstdint>
#include <cstring>

namespace mobee {

typedef double Lanes __attribute__((vector_size(64)));
typedef std::int64_t Marks __attribute__((vector_size(64)));  // of lanes: all bits set, or none
constexpr std::int64_t lanes = 8;

inline Lanes load(const double* from) {
    Lanes value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

inline void store(double* to, Lanes value) { std::memcpy(to, &value, sizeof value); }

inline Marks bits_of(Lanes value) {
    Marks bits;
    std::memcpy(&bits, &value, sizeof bits);
    return bits;
}

}  // namespace mobee
