# SPDX-License-Identifier: Apache-2.0
"""The monitor: a page on loopback and a recording, made from what is published on the bus.

Reads: clock, {part}/state, {part}/motion, model/forces, controller/forces, model/contacts, world/*, vision/image/{left,right},
agents/*/{transition,learned}, event/*, alive/*/*; asks model/rpc/world/list.
Writes: event/monitor; nothing that another service acts on.
"""
