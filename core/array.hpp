// SPDX-License-Identifier: Apache-2.0
// Arrays that own their memory, and views of other arrays.  The library links no C++ runtime: there is neither `new` nor std::vector.
#pragma once

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <new>
#include <type_traits>
#include <utility>

namespace mobee {

// Elements are plain data: they are neither constructed nor destroyed.  If memory cannot be allocated, the process ends, as in NumPy's core.
template <class T>
class Array {
    static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

public:
    Array() = default;
    explicit Array(std::size_t size) { resize(size); }
    Array(const T* from, std::size_t size) : Array(size) {
        if (size > 0) std::memcpy(data_, from, size * sizeof(T));
    }
    Array(Array&& other) noexcept { swap(other); }
    Array& operator=(Array&& other) noexcept {
        swap(other);
        return *this;
    }
    Array(const Array&) = delete;
    Array& operator=(const Array&) = delete;
    ~Array() { std::free(data_); }

    T& operator[](std::size_t i) { return data_[i]; }
    const T& operator[](std::size_t i) const { return data_[i]; }
    T* data() { return data_; }
    const T* data() const { return data_; }
    T* begin() { return data_; }
    const T* begin() const { return data_; }
    T* end() { return data_ + size_; }
    const T* end() const { return data_ + size_; }
    std::size_t size() const { return size_; }

    // The first elements are kept; new elements are zero bytes.
    void resize(std::size_t size) {
        if (size > room_) reserve(size);
        if (size > size_) std::memset(static_cast<void*>(data_ + size_), 0, (size - size_) * sizeof(T));
        size_ = size;
    }

    void push(const T& value) {
        if (size_ == room_) reserve(2 * size_ + 8);
        data_[size_++] = value;
    }

    void clear() { size_ = 0; }

    // The address after the last element, where up to `count` more can be written; `extend` then adds those that were written.
    T* spare(std::size_t count) {
        if (size_ + count > room_) reserve(size_ + count + room_);
        return data_ + size_;
    }

    void extend(std::size_t count) { size_ += count; }
    void shorten(std::size_t size) { size_ = size; }

    void reserve(std::size_t room) {
        if (room <= room_) return;
        void* larger = std::aligned_alloc(64, (room * sizeof(T) + 63) / 64 * 64);
        if (larger == nullptr) std::abort();
        if (size_ > 0) std::memcpy(larger, static_cast<const void*>(data_), size_ * sizeof(T));
        std::free(data_);
        data_ = static_cast<T*>(larger);
        room_ = room;
    }

private:
    void swap(Array& other) noexcept {
        std::swap(data_, other.data_);
        std::swap(size_, other.size_);
        std::swap(room_, other.room_);
    }

    T* data_ = nullptr;
    std::size_t size_ = 0, room_ = 0;
};

// A view of numbers that another owner, such as Python, keeps alive.
template <class T>
struct View {
    T* data = nullptr;
    std::int64_t size = 0;

    T& operator[](std::int64_t i) const { return data[i]; }
    T* begin() const { return data; }
    T* end() const { return data + size; }
};

struct Interval {
    std::int64_t first = 0, end = 0;
};

// An object made in C memory; destroy it with `discard`.
template <class T>
T* make() {
    void* memory = std::aligned_alloc(64, (sizeof(T) + 63) / 64 * 64);
    if (memory == nullptr) std::abort();
    return ::new (memory) T();
}

template <class T>
void discard(T* object) {
    if (object == nullptr) return;
    object->~T();
    std::free(object);
}

}  // namespace mobee
