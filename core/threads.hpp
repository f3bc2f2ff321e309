// SPDX-License-Identifier: Apache-2.0
// Runs work in several threads.
#pragma once

#include <pthread.h>

#include <algorithm>
#include <atomic>
#include <cstdint>

#include "array.hpp"

namespace mobee {

// Process `count` items, in blocks of `size`, in several threads, of which this one is the first; each takes the next block when it is
// free.  Calls work(number of the thread, begin, end) and returns when all items are done, also if the system has fewer threads.
template <class Work>
void share(std::int64_t count, std::int64_t size, std::int64_t threads, const Work& work) {
    std::atomic<std::int64_t> next{0};
    const auto take = [&](std::int64_t thread) {
        for (std::int64_t begin; (begin = next.fetch_add(size, std::memory_order_relaxed)) < count;)
            work(thread, begin, std::min(begin + size, count));
    };
    struct Thread {
        decltype(take)* takes;
        std::int64_t number;
        pthread_t id;
        bool runs;
    };
    constexpr auto entry = [](void* given) -> void* {
        const Thread& thread = *static_cast<Thread*>(given);
        (*thread.takes)(thread.number);
        return nullptr;
    };
    Array<Thread> others(threads);
    for (std::int64_t k = 1; k < threads; ++k) {
        others[k] = {&take, k, {}, false};
        others[k].runs = pthread_create(&others[k].id, nullptr, entry, &others[k]) == 0;
    }
    take(0);
    for (const Thread& thread : others)
        if (thread.runs) pthread_join(thread.id, nullptr);
}

}  // namespace mobee
