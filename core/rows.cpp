// SPDX-License-Identifier: Apache-2.0
#include "rows.hpp"

#include <pthread.h>

#include <algorithm>

#include "interface.hpp"

namespace mobee {

namespace pieces {

constexpr std::size_t large = 1 << 17, largest = 1 << 26;  // bytes: smallest and largest pieces that are kept
constexpr int most = 4;

// The header of a piece of memory.
struct alignas(16) Piece {
    std::size_t bytes;
};

pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
Piece* waiting[most] = {};

Piece* of(void* memory) { return memory == nullptr ? nullptr : static_cast<Piece*>(memory) - 1; }

// Keep a piece in place of a smaller one, if there is one; returns the piece to be freed.
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

// Return the smallest kept piece that is large enough, or null.
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
    piece = static_cast<Piece*>(std::realloc(piece, sizeof(Piece) + bytes));  // moves the pages of a large piece without copying them
    if (piece == nullptr) std::abort();
    piece->bytes = bytes;
    return piece + 1;
}

void end(void* memory) {
    if (memory != nullptr) std::free(pieces::let_wait(pieces::of(memory)));
}

MOBEE_CALL void mobee_rows_end(void* memory) { end(memory); }

}  // namespace mobee
