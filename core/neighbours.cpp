// SPDX-License-Identifier: Apache-2.0
// A neighbour list (Verlet list) of pairs of volumes.  It is valid until two volumes may have moved by the skin, in sum, since the list was
// made.  Until then a listed pair is tested only if the motions of its two volumes add up to the gap between them.  Two shapes of one hand
// are tested only if the joints between them have also turned enough.  Volumes that have not moved are neither placed nor tested.  Where
// consecutive poses are far apart, a list costs more than it saves: then every pose is evaluated without a list.
#include "neighbours.hpp"

#include <cmath>

#include "contacts.hpp"
#include "interface.hpp"
#include "motion.hpp"
#include "rows.hpp"

namespace mobee {

enum class Remembered : std::int64_t { nothing, pose, list, pose_to_renew };  // pose_to_renew: the world has changed while a list was in use

// A pair whose gap was less than the skin when the list was made.
struct Neighbour {
    Pair pair;
    Pair groups;              // of the two volumes
    double gap = 0.0;         // m, at that time
    std::int64_t kept = -1;   // index of the pair's contact at that time; -1: none
};

struct Neighbours {
    const Scene* scene = nullptr;
    Hands hands;
    double skin = 0.0;  // m
    bool cut = false;   // see `project`

    Remembered state = Remembered::nothing;
    std::int64_t served = 0;  // poses that the list has served
    std::int64_t pause = 0;   // number of poses for which no list is made

    Placed placed;
    Motion motion;
    Pairs pairs;
    Array<Neighbour> list;
    Array<Contact> kept;  // contacts when the list was made
    Contacts contacts;
    Array<Pair> close;     // listed pairs to be tested
    Array<Contact> still;  // contacts of pairs of which neither volume has moved
    Pushes pushes;
    Rows rows;
};

namespace following {

constexpr double margin = 1e-9;  // m; larger than the rounding errors of distances and motions
constexpr double short_step = 4.0;   // a list is made only if it would stay valid for this number of steps of the present length
// After an edit of the world, a list that has served at least this number of poses is made again at once.  Otherwise this number of
// poses is evaluated without a list.
constexpr std::int64_t min_served = 4;

// Return whether the list is valid in a pose in which a shape may have moved by `farthest` [m] since the list was made.
bool holds(const Neighbours& near, double farthest) { return near.state == Remembered::list && 2.0 * farthest < near.skin - margin; }

// Return whether to make a list if none is valid.
bool pays(Neighbours& near, double farthest) {
    if (near.state == Remembered::list) return near.served > 1;
    if (near.pause > 0) {
        --near.pause;
        return false;
    }
    return near.state == Remembered::pose_to_renew || (near.state == Remembered::pose && short_step * 2.0 * farthest < near.skin);
}

// Return an upper bound of the sum of the motions of a listed pair's two volumes [m].
double travel_of_pair(Neighbours& near, Pair pair) {
    const Robot& robot = *near.scene->robot;
    const double travel = travel_of(robot, pair.first, near.placed, near.motion);
    return pair.second < robot.slots() ? travel + travel_of(robot, pair.second, near.placed, near.motion) : travel;
}

// Return a looser upper bound from their groups alone, without placing the volumes.
double travel_of_groups(const Motion& motion, Pair groups) { return motion.far[groups.first] + motion.far[groups.second]; }

// Return the groups of two shapes, or of a shape and an object.
Pair groups_of(const Neighbours& near, Pair pair) {
    const Motion& motion = near.motion;
    const bool own = pair.second < near.scene->robot->slots();
    const auto group_of = [&](std::int32_t slot) { return static_cast<std::int32_t>(motion.group_of[slot]); };
    return {group_of(pair.first), own ? group_of(pair.second) : static_cast<std::int32_t>(motion.group.size())};
}

// Return an upper bound of the approach of two shapes of the robot, seen from the link that carries both [m].
double approach(const Neighbours& near, Pair pair) {
    const Robot& robot = *near.scene->robot;
    const Shape &a = robot.shape[pair.first], &b = robot.shape[pair.second];
    const std::int64_t base = robot.common[a.link * robot.links + b.link];
    return swung(near.motion, a.link, base, a.lever) + swung(near.motion, b.link, base, b.lever);
}

// Collect the listed pairs that may touch, and the contacts of the pairs of which neither volume has moved.
void gather(Neighbours& near) {
    near.close.clear();
    near.still.clear();
    bool bent = false;
    for (const Neighbour& one : near.list) {
        if (travel_of_groups(near.motion, one.groups) < one.gap) continue;
        const double between = travel_of_pair(near, one.pair);
        if (between < one.gap) continue;
        if (between == 0.0) {
            if (one.kept >= 0) near.still.push(near.kept[one.kept]);
            continue;
        }
        if (one.gap > 0.0 && one.pair.second < near.scene->robot->slots()) {
            if (!bent) bend_links(*near.scene->robot, near.placed.links.angles.data(), near.motion);
            bent = true;
            if (approach(near, one.pair) < one.gap) continue;
        }
        near.close.push(one.pair);
    }
}

void use_list(Neighbours& near) {
    gather(near);
    find_contacts(*near.scene, near.hands, near.placed, near.close, near.contacts.found);
    for (const Contact& one : near.still) near.contacts.found.push(one);
}

void make_list(Neighbours& near) {
    near.list.clear();
    near.contacts.found.clear();
    Touch touch;
    Contact contact;
    for (const Pair pair : near.pairs.left) {
        const double depth = overlap_of(*near.scene, near.placed, pair, touch);
        if (-depth >= near.skin) continue;
        Neighbour one{pair, groups_of(near, pair), -depth - margin, -1};
        if (depth > 0.0 && name_contact(*near.scene, near.hands, pair, depth, touch, contact)) {
            one.kept = static_cast<std::int64_t>(near.contacts.found.size());
            near.contacts.found.push(contact);
        }
        near.list.push(one);
    }
    near.kept.clear();
    for (const Contact& one : near.contacts.found) near.kept.push(one);
}

// Test all pairs.
void start_anew(Neighbours& near, bool build) {
    const Scene& scene = *near.scene;
    bound_clusters(*scene.robot, near.placed);
    const double skin = build ? near.skin : 0.0;
    find_pairs(scene, near.placed, skin, near.pairs);
    sieve(scene, near.placed, skin, near.pairs);
    remember(near.placed, near.motion);
    if (build) {
        make_list(near);
    } else {
        find_contacts(scene, near.hands, near.placed, near.pairs.left, near.contacts.found);
    }
    near.state = build ? Remembered::list : Remembered::pose;
    near.served = 0;
}

}  // namespace following

std::int64_t find(Neighbours& near, const double* q) {
    const Robot& robot = *near.scene->robot;
    const bool fresh = near.state == Remembered::nothing || near.state == Remembered::pose_to_renew;
    joint_angles(robot, q, near.placed.links.angles.data());
    find_moved(robot, near.placed.links.angles.data(), fresh, near.motion);
    place_links(robot, near.motion.moved.data(), near.placed.links);
    double farthest = measure_groups(robot, near.placed.links, near.motion);
    if (!following::holds(near, farthest)) farthest = measure_shapes(robot, near.placed, near.motion);
    if (following::holds(near, farthest)) {
        ++near.served;
        following::use_list(near);
    } else {
        following::start_anew(near, following::pays(near, farthest));
    }
    return static_cast<std::int64_t>(near.contacts.found.size());
}

void project_contacts(Neighbours& near, double* torque) {
    sort_contacts(*near.scene, near.contacts);
    project(*near.scene->robot, near.placed.links.frame.data(), near.contacts.found, near.cut, near.pushes, torque);
}

const Contact& contact(const Neighbours& near, std::int64_t index) { return near.contacts.found[index]; }

MOBEE_CALL Neighbours* mobee_neighbours_new(double skin, std::int64_t cut) {
    Neighbours* near = make<Neighbours>();
    near->skin = skin;
    near->cut = cut != 0;
    return near;
}

MOBEE_CALL void mobee_neighbours_free(Neighbours* near) { discard(near); }

// Change the world, or the set of reaching hands.
MOBEE_CALL void mobee_neighbours_enter(Neighbours* near, const Scene* scene, const Hands* hands) {
    const bool was_of_use = near->state == Remembered::list && near->served >= following::min_served;
    const bool first = near->scene == nullptr;
    near->scene = scene;
    near->hands = *hands;
    near->state = was_of_use ? Remembered::pose_to_renew : Remembered::nothing;
    near->pause = was_of_use || first ? 0 : following::min_served;  // in a moving world lists are soon out of date
    near->placed.fit(*scene->robot);
    near->motion.fit(*scene->robot);
    near->pushes.fit(*scene->robot);
}

// Find the contacts in each pose of q (poses, motors) and their torques (poses, motors).  Return the number of contacts.
MOBEE_CALL std::int64_t mobee_follow(Neighbours* near, const double* q, std::int64_t poses, double* torque) {
    const std::int64_t motors = near->scene->robot->motors;
    near->rows.size = 0;
    std::memset(torque, 0, poses * motors * sizeof(double));
    for (std::int64_t b = 0; b < poses; ++b) {
        if (find(*near, q + b * motors) == 0) continue;
        project_contacts(*near, torque + b * motors);
        near->rows.append(b, near->contacts.found);
    }
    return static_cast<std::int64_t>(near->rows.size);
}

// Copy out the rows of the last `mobee_follow`, see `mobee_room_rows`.
MOBEE_CALL void mobee_neighbours_rows(Neighbours* near, void** arrays) { near->rows.give(arrays); }

// For tests: the state, the number of listed pairs, and the number of poses that the list has served.
MOBEE_CALL void mobee_neighbours_state(const Neighbours* near, std::int64_t* state) {
    state[0] = static_cast<std::int64_t>(near->state);
    state[1] = static_cast<std::int64_t>(near->list.size());
    state[2] = near->served;
}

// For tests: upper bounds of the motion of each shape between the angles `then` and `now`, (shapes, links).  Column k is the motion as
// seen from the link that carries both the shape and link k.
MOBEE_CALL void mobee_swung(const Robot* robot, const double* then, const double* now, double* out) {
    Motion motion;
    motion.fit(*robot);
    std::copy(then, then + robot->joints, motion.angles.begin());
    bend_links(*robot, now, motion);
    for (const Cluster cluster : robot->cluster) {
        for (std::int64_t i = cluster.first; i < cluster.end; ++i) {
            const Shape& shape = robot->shape[i];
            for (std::int64_t other = 0; other < robot->links; ++other)
                *out++ = swung(motion, shape.link, robot->common[shape.link * robot->links + other], shape.lever);
        }
    }
}

}  // namespace mobee
