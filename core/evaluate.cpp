// SPDX-License-Identifier: Apache-2.0
// The contacts of many poses at once.  One pose is a batch of one, and threads share a batch in blocks; the results are bit-equal.
#include "contacts.hpp"
#include "interface.hpp"
#include "rows.hpp"
#include "threads.hpp"

namespace mobee {

// The buffers of one thread, kept for the next evaluation.
struct Worker {
    Placed placed;
    Pairs pairs;
    Contacts contacts;
    Pushes pushes;
    Rows rows;
};

// The buffers of one evaluation.
struct Room {
    Array<Worker*> workers;

    void make_workers(std::int64_t count) {
        while (static_cast<std::int64_t>(workers.size()) < count) workers.push(make<Worker>());
    }

    ~Room() {
        for (Worker* worker : workers) discard(worker);
    }
};

// The arguments from Python, see mobee/_core/engine.py.
struct Request {
    const Scene* scene;
    const double* q;  // (poses, motors)
    double* torque;  // (poses, motors), overwritten
    std::int64_t poses, cut, threads;
    Hands hands;
};

// The same for one pose.
struct RequestOfOne {
    Room* room;
    const Scene* scene;
    double* torque;  // (motors,), overwritten
    void* rows;      // buffer for `most` contacts: the integers of all, then the real numbers of all
    std::int64_t most, cut;
    Hands hands;
};

namespace evaluation {

void fit(Worker& worker, const Robot& robot) {
    worker.placed.fit(robot);
    worker.pushes.fit(robot);
}

// Find the contacts of one pose q (motors,), sorted, and their projection to the motors, `torque` (motors,).
const Array<Contact>& contacts_at(const Scene& scene, const double* q, const Hands& hands, bool cut, Worker& worker, double* torque) {
    const Robot& robot = *scene.robot;
    Placed& placed = worker.placed;
    std::memset(torque, 0, robot.motors * sizeof(double));
    joint_angles(robot, q, placed.links.angles.data());
    place(robot, placed);
    bound_clusters(robot, placed);
    find_pairs(scene, placed, 0.0, worker.pairs);
    sieve(scene, placed, 0.0, worker.pairs);
    Array<Contact>& found = worker.contacts.found;
    find_contacts(scene, hands, placed, worker.pairs.left, found);
    if (found.size() == 0) return found;
    sort_contacts(scene, worker.contacts);
    project(robot, placed.links.frame.data(), found, cut, worker.pushes, torque);
    return found;
}

// Evaluate the poses from `begin` to before `end`.
void run(const Request& request, std::int64_t begin, std::int64_t end, Worker& worker) {
    const Scene& scene = *request.scene;
    const std::int64_t motors = scene.robot->motors;
    fit(worker, *scene.robot);
    for (std::int64_t b = begin; b < end; ++b) {
        const double* q = request.q + b * motors;
        worker.rows.append(b, contacts_at(scene, q, request.hands, request.cut != 0, worker, request.torque + b * motors));
    }
}

}  // namespace evaluation

MOBEE_CALL Room* mobee_room_new() { return make<Room>(); }

MOBEE_CALL void mobee_room_free(Room* room) { discard(room); }

// Hand over the rows of the last evaluation, in the order of the poses: integers, and real numbers; `mobee_rows_end` frees each.
MOBEE_CALL void mobee_room_rows(Room* room, void** arrays) {
    Rows& all = room->workers[0]->rows;
    for (std::size_t k = 1; k < room->workers.size(); ++k) {
        all.append(room->workers[k]->rows);
        room->workers[k]->rows.size = 0;
    }
    all.give(arrays);
}

// Find the contacts of all poses; returns their number.  `mobee_room_rows` hands them over.
MOBEE_CALL std::int64_t mobee_evaluate(Room* room, const Request* request) {
    const std::int64_t most_threads = request->poses > 1 ? request->poses : 1;
    const std::int64_t threads = request->threads < most_threads ? request->threads : most_threads;
    room->make_workers(threads);
    for (Worker* worker : room->workers) worker->rows.size = 0;
    share(threads, 1, threads, [&](std::int64_t, std::int64_t k, std::int64_t) {
        evaluation::run(*request, request->poses * k / threads, request->poses * (k + 1) / threads, *room->workers[k]);
    });
    std::size_t rows = 0;
    for (const Worker* worker : room->workers) rows += worker->rows.size;
    return static_cast<std::int64_t>(rows);
}

// The same for one pose q (motors,).  Contacts beyond `most` are only counted.
MOBEE_CALL std::int64_t mobee_evaluate_one(const RequestOfOne* request, const double* q) {
    Room& room = *request->room;
    room.make_workers(1);
    Worker& worker = *room.workers[0];
    evaluation::fit(worker, *request->scene->robot);
    const Array<Contact>& found = evaluation::contacts_at(*request->scene, q, request->hands, request->cut != 0, worker, request->torque);
    const auto count = static_cast<std::int64_t>(found.size());
    if (count <= request->most) {
        auto* numbers = static_cast<ContactNumbers*>(request->rows);
        write_rows(0, found, numbers, reinterpret_cast<ContactReals*>(numbers + count));
    }
    return count;
}

}  // namespace mobee
