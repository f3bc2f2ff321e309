// Contacts as Python gets them, see ContactTable in mobee/collision/contact.py: two arrays of numbers, a row a contact.
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

// Grows by `realloc`, which moves pages of large arrays instead of copying them; whoever takes the arrays frees them.
struct Rows {
    ContactNumbers* numbers = nullptr;
    ContactReals* reals = nullptr;
    std::size_t size = 0, room = 0;

    Rows() = default;
    Rows(const Rows&) = delete;
    Rows& operator=(const Rows&) = delete;
    ~Rows() {
        std::free(numbers);
        std::free(reals);
    }

    void resize_to(std::size_t rows) {
        auto* more_numbers = static_cast<ContactNumbers*>(std::realloc(numbers, rows * sizeof(ContactNumbers)));
        auto* more_reals = static_cast<ContactReals*>(std::realloc(reals, rows * sizeof(ContactReals)));
        if (more_numbers == nullptr || more_reals == nullptr) std::abort();
        numbers = more_numbers;
        reals = more_reals;
        room = rows;
    }

    void make_room(std::size_t rows) {
        if (size + rows > room) resize_to(2 * (size + rows) + 64);
    }

    void append(std::int64_t pose, const Array<Contact>& contacts) {
        make_room(contacts.size());
        for (const Contact& one : contacts) {
            numbers[size] = {pose, one.kind, one.first, one.second, one.first_link, one.second_link};
            reals[size++] = {one.depth, one.touch};
        }
    }

    void append(const Rows& others) {
        if (others.size == 0) return;
        make_room(others.size);
        std::memcpy(numbers + size, others.numbers, others.size * sizeof(ContactNumbers));
        std::memcpy(reals + size, others.reals, others.size * sizeof(ContactReals));
        size += others.size;
    }

    // Write all to arrays of others.
    void copy_to(ContactNumbers* to_numbers, ContactReals* to_reals) const {
        if (size == 0) return;
        std::memcpy(to_numbers, numbers, size * sizeof(ContactNumbers));
        std::memcpy(to_reals, reals, size * sizeof(ContactReals));
    }

    // Give both arrays away.
    void give(void** arrays) {
        if (size > 0) resize_to(size);
        arrays[0] = numbers;
        arrays[1] = reals;
        numbers = nullptr;
        reals = nullptr;
        size = room = 0;
    }
};

}  // namespace mobee
