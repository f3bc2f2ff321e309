// SPDX-License-Identifier: Apache-2.0
// Four or eight numbers in one register, or in several on a processor with narrower registers; the results are bit-equal.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>

#if defined(__x86_64__)
#include <immintrin.h>
#endif

#include "vector.hpp"

namespace mobee {

typedef std::int64_t FourMarks __attribute__((vector_size(32)));  // of four: all bits set, or none
typedef float Eight __attribute__((vector_size(32)));
typedef std::int32_t EightInts __attribute__((vector_size(32)));
constexpr std::int64_t lanes = 8;

template <class V>
inline V load(const void* from) {
    V value;
    std::memcpy(&value, from, sizeof value);
    return value;
}

#if defined(__SSE2__) && !defined(__AVX__)
// Two registers in place of one twice as wide, since compilers compare such vectors number by number.
struct Doubles {
    __m128d low, high;
};

struct Singles {
    __m128 low, high;
};

inline Doubles halves(Four value) { return load<Doubles>(&value); }
inline Singles halves(Eight value) { return load<Singles>(&value); }
#endif

// If a is NaN the result is b, as in `least` and `most`.
#if defined(__SSE2__) && !defined(__AVX__)
inline Four least_of(Four a, Four b) {
    const auto [a_low, a_high] = halves(a);
    const auto [b_low, b_high] = halves(b);
    const Doubles found{_mm_min_pd(a_low, b_low), _mm_min_pd(a_high, b_high)};
    return load<Four>(&found);
}
inline Four most_of(Four a, Four b) {
    const auto [a_low, a_high] = halves(a);
    const auto [b_low, b_high] = halves(b);
    const Doubles found{_mm_max_pd(a_low, b_low), _mm_max_pd(a_high, b_high)};
    return load<Four>(&found);
}
inline Eight most_of(Eight a, Eight b) {
    const auto [a_low, a_high] = halves(a);
    const auto [b_low, b_high] = halves(b);
    const Singles found{_mm_max_ps(a_low, b_low), _mm_max_ps(a_high, b_high)};
    return load<Eight>(&found);
}
#else
inline Four least_of(Four a, Four b) { return a < b ? a : b; }
inline Four most_of(Four a, Four b) { return a > b ? a : b; }
inline Eight most_of(Eight a, Eight b) { return a > b ? a : b; }
#endif
inline Four unit_of(Four value) { return least_of(most_of(value, Four{} - 1.0), Four{} + 1.0); }
inline Four absolute_of(Four value) { return most_of(value, -value); }

// Bit k is set if a[k] < b[k].
inline unsigned less(Four a, Four b) {
#if defined(__AVX__)
    return static_cast<unsigned>(_mm256_movemask_pd(_mm256_cmp_pd(reinterpret_cast<__m256d>(a), reinterpret_cast<__m256d>(b), _CMP_LT_OQ)));
#elif defined(__SSE2__)
    const auto [a_low, a_high] = halves(a);
    const auto [b_low, b_high] = halves(b);
    return static_cast<unsigned>(_mm_movemask_pd(_mm_cmplt_pd(a_low, b_low)) | _mm_movemask_pd(_mm_cmplt_pd(a_high, b_high)) << 2);
#else
    unsigned found = 0;
    for (int k = 0; k < 4; ++k) found |= static_cast<unsigned>(a[k] < b[k]) << k;
    return found;
#endif
}

inline unsigned less(Eight a, Eight b) {
#if defined(__AVX__)
    return static_cast<unsigned>(_mm256_movemask_ps(_mm256_cmp_ps(reinterpret_cast<__m256>(a), reinterpret_cast<__m256>(b), _CMP_LT_OQ)));
#elif defined(__SSE2__)
    const auto [a_low, a_high] = halves(a);
    const auto [b_low, b_high] = halves(b);
    return static_cast<unsigned>(_mm_movemask_ps(_mm_cmplt_ps(a_low, b_low)) | _mm_movemask_ps(_mm_cmplt_ps(a_high, b_high)) << 4);
#else
    unsigned found = 0;
    for (int k = 0; k < lanes; ++k) found |= static_cast<unsigned>(a[k] < b[k]) << k;
    return found;
#endif
}

inline Eight root_of(Eight value) {
#if defined(__AVX__)
    return reinterpret_cast<Eight>(_mm256_sqrt_ps(reinterpret_cast<__m256>(value)));
#elif defined(__SSE2__)
    const auto [low, high] = halves(value);
    const Singles found{_mm_sqrt_ps(low), _mm_sqrt_ps(high)};
    return load<Eight>(&found);
#else
    for (int k = 0; k < lanes; ++k) value[k] = std::sqrt(value[k]);
    return value;
#endif
}

#if defined(__AVX2__) && !defined(__AVX512VL__)
// For each subset of eight lanes: the indices of its lanes, in order.
struct Choices {
    std::uint8_t of[256][lanes] = {};

    constexpr Choices() {
        for (int which = 0; which < 256; ++which)
            for (int k = 0, count = 0; k < lanes; ++k)
                if ((which >> k & 1) != 0) of[which][count++] = static_cast<std::uint8_t>(k);
    }
};

inline constexpr Choices choices;
#endif

// Write those of the eight numbers whose bit is set, one after the other; up to eight numbers may be overwritten.  Returns the end.  There
// is no branch, since the processor could not predict which volumes are near.
inline std::int32_t* put(std::int32_t* to, EightInts from, unsigned which) {
#if defined(__AVX512VL__)
    const __m256i chosen = _mm256_maskz_compress_epi32(static_cast<__mmask8>(which), reinterpret_cast<__m256i>(from));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), chosen);
    return to + std::popcount(which);
#elif defined(__AVX2__)
    const __m256i order = _mm256_cvtepu8_epi32(_mm_loadl_epi64(reinterpret_cast<const __m128i*>(choices.of[which])));
    _mm256_storeu_si256(reinterpret_cast<__m256i*>(to), _mm256_permutevar8x32_epi32(reinterpret_cast<__m256i>(from), order));
    return to + std::popcount(which);
#else
    for (; which != 0; which &= which - 1) *to++ = from[std::countr_zero(which)];
    return to;
#endif
}

inline float most_in(Eight v) {
    v = most_of(v, __builtin_shufflevector(v, v, 4, 5, 6, 7, 0, 1, 2, 3));
    v = most_of(v, __builtin_shufflevector(v, v, 2, 3, 0, 1, 6, 7, 4, 5));
    return v[0] > v[1] ? v[0] : v[1];
}

inline Four root_of(Four value) {
#if defined(__AVX__)
    return reinterpret_cast<Four>(_mm256_sqrt_pd(reinterpret_cast<__m256d>(value)));
#elif defined(__SSE2__)
    const auto [low, high] = halves(value);
    const Doubles found{_mm_sqrt_pd(low), _mm_sqrt_pd(high)};
    return load<Four>(&found);
#else
    for (int k = 0; k < 4; ++k) value[k] = std::sqrt(value[k]);
    return value;
#endif
}

inline void store(double* to, Four value) { std::memcpy(to, &value, sizeof value); }

// Sine and 1 - cosine of angles up to 1e5: reduced to a quarter turn (Cody and Waite), then a Taylor series to 1e-17.
inline void sine_cosine(Four angle, Four& sine, Four& cosine) {
    constexpr double pi_2_high = 1.5707963267341256, pi_2_middle = 6.077100506303966e-11, pi_2_low = 2.0222662487959506e-21;
    constexpr double rounder = 6755399441055744.0;  // 1.5 * 2^52: added to a number, it leaves the nearest integer in the last bits
    const Four shifted = angle * 0.6366197723675814 + rounder;
    const Four quarter = shifted - rounder;
    const Four x = ((angle - quarter * pi_2_high) - quarter * pi_2_middle) - quarter * pi_2_low;
    const Four z = x * x;
    Four s = z * (1.6059043836821613e-10 - z * 7.647163731819816e-13);
    s = z * (-1.984126984126984e-04 + z * (2.7557319223985893e-06 - z * 2.505210838544172e-08 + z * s));
    s = x + x * z * (-1.6666666666666666e-01 + z * 8.333333333333333e-03 + z * s);
    Four c = z * (2.08767569878681e-09 - z * (1.1470745597729725e-11 - z * 4.779477332387385e-14));
    c = z * (-1.3888888888888889e-03 + z * (2.48015873015873e-05 - z * 2.755731922398589e-07 + z * c));
    c = z * (0.5 - z * (4.1666666666666664e-02 + c));
    FourMarks turn;
    std::memcpy(&turn, &shifted, sizeof turn);
    turn &= 3;
    const FourMarks odd = (turn & 1) == 1;
    const Four big = odd ? 1.0 - c : s;
    const Four small = odd ? s : 1.0 - c;
    sine = turn >= 2 ? -big : big;
    cosine = turn == 0 ? c : 1.0 - (((turn ^ (turn >> 1)) & 1) == 1 ? -small : small);
}

inline void store_single(float* to, Four value) {
    typedef float FourSingle __attribute__((vector_size(16)));
    const FourSingle single = __builtin_convertvector(value, FourSingle);
    std::memcpy(to, &single, sizeof single);
}

// Transpose four vectors: return their first, second, third and fourth numbers.
inline void transpose(Four& a, Four& b, Four& c, Four& d) {
    const Four p = __builtin_shufflevector(a, b, 0, 4, 2, 6), q = __builtin_shufflevector(a, b, 1, 5, 3, 7);
    const Four r = __builtin_shufflevector(c, d, 0, 4, 2, 6), s = __builtin_shufflevector(c, d, 1, 5, 3, 7);
    a = __builtin_shufflevector(p, r, 0, 1, 4, 5);
    b = __builtin_shufflevector(q, s, 0, 1, 4, 5);
    c = __builtin_shufflevector(p, r, 2, 3, 6, 7);
    d = __builtin_shufflevector(q, s, 2, 3, 6, 7);
}

// Return the first three numbers of a and the fourth of b.
inline Four with_fourth(Four a, Four b) { return __builtin_shufflevector(a, b, 0, 1, 2, 7); }

inline double sum_of_three(Four v) { return v[0] + v[1] + v[2]; }

}  // namespace mobee
