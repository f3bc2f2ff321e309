// Standard normals that are a pure function of seed, tick and motor: who knows these draws the same (Box and Muller).
#pragma once

#include <cstdint>

namespace mobee {

// Motors 2 c and 2 c + 1 are couple c: two normals come of two numbers.
struct Normals {
    static constexpr std::int64_t at_once = 32;  // couples, a multiple of the lanes

    Normals(std::uint64_t seed, std::int64_t tick);

    // Whether a couple is the one taken last, or there is room for it.
    bool takes(std::int64_t couple) const { return count < at_once || couples[count - 1] == couple; }

    void take(std::int64_t couple) {
        if (count == 0 || couples[count - 1] != couple) couples[count++] = couple;
    }

    // Fill `even` and `odd` for the couples that were taken.
    void draw();

    std::int64_t count = 0;
    std::int64_t couples[at_once];
    double even[at_once], odd[at_once];

private:
    std::uint64_t key_;
};

// The same of four ticks, one after the other.
class NormalsOfTicks {
public:
    NormalsOfTicks(std::uint64_t seed, std::int64_t tick);

    // Fill `even` and `odd`, a number for each tick.
    void draw(std::int64_t couple, double* even, double* odd) const;

private:
    std::uint64_t key_[4];
};

}  // namespace mobee
