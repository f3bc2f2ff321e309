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

struct Rows {
    Array<ContactNumbers> numbers;
    Array<ContactReals> reals;

    void clear() {
        numbers.clear();
        reals.clear();
    }

    void append(std::int64_t pose, const Array<Contact>& contacts) {
        ContactNumbers* number = numbers.spare(contacts.size());
        ContactReals* real = reals.spare(contacts.size());
        for (const Contact& one : contacts) {
            *number++ = {pose, one.kind, one.first, one.second, one.first_link, one.second_link};
            *real++ = {one.depth, one.touch};
        }
        numbers.extend(contacts.size());
        reals.extend(contacts.size());
    }

    // Write all behind the `used` rows of others, and forget them.
    void hand_over(ContactNumbers* to_numbers, ContactReals* to_reals, std::size_t used) {
        if (numbers.size() > 0) {
            std::memcpy(to_numbers + used, numbers.data(), numbers.size() * sizeof(ContactNumbers));
            std::memcpy(to_reals + used, reals.data(), reals.size() * sizeof(ContactReals));
        }
        constexpr std::size_t kept = 8192;  // rows: what stays allocated for the next evaluation
        if (numbers.size() > kept) *this = Rows{};
        clear();
    }
};

}  // namespace mobee
