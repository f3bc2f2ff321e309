// SPDX-License-Identifier: Apache-2.0
#include "rows.hpp"

#include <pthread.h>

#include <algorithm>

#include "interface.hpp"

namespace mobee {

namespace pieces {

constexpr std::size_t large = 1 << 17, largest = 1 << 26;  // bytes of those that wait
constexpr int most = 4;

// In front of the memory that is used.
struct alignas(16) Piece {
    std::size_t bytes;
};

pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
Piece* waiting[most] = {};

Piece* of(void* memory) { return memory == nullptr ? nullptr : static_cast<Piece*>(memory) - 1; }

// Put a piece in the place of a smaller one, if there is one; gives what is to be ended.
Piece* let_wait(Piece* piece) {
    if (piece->bytes < large || piece->bytes > largest) return piece;
    pthread_mutex_lock(&lock);
    for (Piece*& place : waiting) {
        if (place == nullptr || place->bytes < piece->bytes) std::swap(place, piece);
        if (piece == nullptr) break;
    }
    pthread_mutex_unlock(&lock);
    return piece;
}

// The smallest piece that is large enough, or none.
Piece* take(std::size_t bytes) {
    if (bytes < large) return nullptr;
    Piece** best = nullptr;
    pthread_mutex_lock(&lock);
    for (Piece*& place : waiting)
        if (place != nullptr && place->bytes >= bytes && (best == nullptr || place->bytes < (*best)->bytes)) best = &place;
    Piece* found = best == nullptr ? nullptr : std::exchange(*best, nullptr);
    pthread_mutex_unlock(&lock);
    return found;
}

}  // namespace pieces

void* resized(void* old, std::size_t bytes) {
    using pieces::Piece;
    Piece* piece = pieces::of(old);
    if (piece != nullptr && piece->bytes >= bytes) return old;
    Piece* kept = pieces::take(bytes);
    if (kept != nullptr) {
        if (piece != nullptr) std::memcpy(kept + 1, piece + 1, std::min(piece->bytes, kept->bytes));
        end(old);
        return kept + 1;
    }
    piece = static_cast<Piece*>(std::realloc(piece, sizeof(Piece) + bytes));  // which moves the pages of large ones, without a copy
    if (piece == nullptr) std::abort();
    piece->bytes = bytes;
    return piece + 1;
}

void end(void* memory) {
    if (memory != nullptr) std::free(pieces::let_wait(pieces::of(memory)));
}

MOBEE_CALL void mobee_rows_end(void* memory) { end(memory); }

}  // namespace mobee
