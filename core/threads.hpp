// The same work in several threads.
#pragma once

#include <pthread.h>

#include <atomic>
#include <cstdint>

#include "array.hpp"

namespace mobee {

// A count of things to do, handed out in blocks to whoever has time.
class Blocks {
public:
    Blocks(std::int64_t count, std::int64_t size) : count_(count), size_(size) {}

    // The next block, from `begin` to before `end`; false when there is none.
    bool take(std::int64_t& begin, std::int64_t& end) {
        begin = next_.fetch_add(size_, std::memory_order_relaxed);
        end = begin + size_ < count_ ? begin + size_ : count_;
        return begin < count_;
    }

private:
    std::int64_t count_, size_;
    std::atomic<std::int64_t> next_{0};
};

// Call run() of all workers, the first in this thread, and wait until all have returned.  For those for which the system has no thread
// nothing is called: the others take their blocks.
template <class Worker>
void run_together(const Array<Worker*>& workers) {
    struct Thread {
        pthread_t id;
        bool runs;
    };
    constexpr auto entry = [](void* worker) -> void* {
        static_cast<Worker*>(worker)->run();
        return nullptr;
    };
    Array<Thread> threads(workers.size());
    for (std::size_t k = 1; k < workers.size(); ++k) threads[k].runs = pthread_create(&threads[k].id, nullptr, entry, workers[k]) == 0;
    workers[0]->run();
    for (const Thread& thread : threads)
        if (thread.runs) pthread_join(thread.id, nullptr);
}

}  // namespace mobee
