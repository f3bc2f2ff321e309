// SPDX-License-Identifier: Apache-2.0
// Contacts in the form for Python, see ContactTable in mobee/model/contact.py: two arrays of numbers, one row per contact.
#pragma once

#include <cstdint>

#include "array.hpp"
#include "contact.hpp"

namespace mobee {

struct ContactNumbers {
    std::int64_t pose, kind, first, second, first_link, second_link;
};

struct ContactReals {
    double depth;
    Touch touch;
};

// A row for each contact of a pose.
inline void write_rows(std::int64_t pose, const Array<Contact>& contacts, ContactNumbers* numbers, ContactReals* reals) {
    for (const Contact& one : contacts) {
        *numbers++ = {pose, one.kind, one.first, one.second, one.first_link, one.second_link};
        *reals++ = {one.depth, one.touch};
    }
}

// Memory for rows.  Large freed pieces are kept for the next user: for a batch, allocating them anew would take a tenth of the time of
// the search.  `resized` returns memory with the content of the old piece, which may be null.
void* resized(void* old, std::size_t bytes);
void end(void* memory);

// The owner of the arrays must free each.
struct Rows {
    ContactNumbers* numbers = nullptr;
    ContactReals* reals = nullptr;
    std::size_t size = 0, room = 0;

    Rows() = default;
    Rows(const Rows&) = delete;
    Rows& operator=(const Rows&) = delete;
    ~Rows() {
        end(numbers);
        end(reals);
    }

    void make_room(std::size_t rows) {
        if (size + rows <= room) return;
        room = 2 * (size + rows) + 64;
        numbers = static_cast<ContactNumbers*>(resized(numbers, room * sizeof(ContactNumbers)));
        reals = static_cast<ContactReals*>(resized(reals, room * sizeof(ContactReals)));
    }

    void append(std::int64_t pose, const Array<Contact>& contacts) {
        make_room(contacts.size());
        write_rows(pose, contacts, numbers + size, reals + size);
        size += contacts.size();
    }

    void append(const Rows& others) {
        if (others.size == 0) return;
        make_room(others.size);
        std::memcpy(numbers + size, others.numbers, others.size * sizeof(ContactNumbers));
        std::memcpy(reals + size, others.reals, others.size * sizeof(ContactReals));
        size += others.size;
    }

    // Hand both arrays over to the caller.
    void give(void** arrays) {
        arrays[0] = numbers;
        arrays[1] = reals;
        numbers = nullptr;
        reals = nullptr;
        size = room = 0;
    }
};

}  // namespace mobee
