// SPDX-License-Identifier: Apache-2.0
// Standard normal numbers as a pure function of seed, tick and motor (Box and Muller).
#pragma once

#include <cstdint>
#include <cstring>

#include "lanes.hpp"

namespace mobee {

namespace normals {

// Counters are mixed as by splitmix64 (Steele, Lea, Flood 2014): every bit of x changes each of the result with probability 1/2.
inline std::uint64_t mixed(std::uint64_t x) {
    x += 0x9E3779B97F4A7C15u;
    x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9u;
    x = (x ^ (x >> 27)) * 0x94D049BB133111EBu;
    return x ^ (x >> 31);
}

// The natural logarithm of normal floating-point numbers above 0, to two units in the last place: x = 2^e m, 1/sqrt(2) <= m <= sqrt(2),
// and log m = 2 artanh((m - 1) / (m + 1)).  The bits are the same on every system, unlike those of C libraries.
inline Four logarithm(Four x) {
    constexpr double ln_2_high = 0.6931471803691238, ln_2_low = 1.9082149292705877e-10;  // the first has 21 bits of zeros at its end
    constexpr double root_2 = 1.4142135623730951;
    constexpr std::int64_t mantissa = 0xFFFFFFFFFFFFF, one = 0x3FF0000000000000, integers = 0x4330000000000000;
    FourMarks bits;
    std::memcpy(&bits, &x, sizeof bits);
    const FourMarks fraction = (bits & mantissa) | one;
    const FourMarks counted = (bits >> 52) | integers;  // as a floating-point number: 2^52 plus the integer
    Four m, e;
    std::memcpy(&m, &fraction, sizeof m);
    std::memcpy(&e, &counted, sizeof e);
    e -= 0x1p52 + 1023.0;
    const FourMarks above = m > root_2;
    m = above ? 0.5 * m : m;
    e = above ? e + 1.0 : e;
    const Four s = (m - 1.0) / (m + 1.0), z = s * s;
    Four series = 1.0 / 17.0 + z * (1.0 / 19.0 + z * (1.0 / 21.0 + z * (1.0 / 23.0)));
    series = 1.0 / 9.0 + z * (1.0 / 11.0 + z * (1.0 / 13.0 + z * (1.0 / 15.0 + z * series)));
    series = z * (1.0 / 3.0 + z * (1.0 / 5.0 + z * (1.0 / 7.0 + z * series)));
    return e * ln_2_high + (2.0 * s + (2.0 * s * series + e * ln_2_low));
}

}  // namespace normals

// The normal numbers of four successive ticks, which take no more time than those of one.
class Normals {
public:
    Normals(std::uint64_t seed, std::int64_t tick) {
        for (std::int64_t j = 0; j < 4; ++j) key_[j] = normals::mixed(normals::mixed(seed) ^ static_cast<std::uint64_t>(tick + j));
    }

    // Fill `even` and `odd` for motors 2 c and 2 c + 1, one number per tick: the method makes two normal numbers from two uniform ones.
    void draw(std::int64_t couple, double* even, double* odd) const {
        constexpr double unit = 0x1p-53, turn = 2.0 * 3.14159265358979323846;
        Four uniform, angle, sine, less;  // `less`: 1 - cosine
        for (std::int64_t j = 0; j < 4; ++j) {
            const std::uint64_t first = normals::mixed(key_[j] ^ normals::mixed(static_cast<std::uint64_t>(couple)));
            uniform[j] = (static_cast<double>(static_cast<std::int64_t>(first >> 11)) + 1.0) * unit;
            angle[j] = turn * (static_cast<double>(static_cast<std::int64_t>(normals::mixed(first) >> 11)) * unit);
        }
        sine_cosine(angle, sine, less);
        const Four radius = root_of(-2.0 * normals::logarithm(uniform));
        store(even, radius * (1.0 - less));
        store(odd, radius * sine);
    }

private:
    std::uint64_t key_[4];
};

}  // namespace mobee
