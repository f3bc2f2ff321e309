# SPDX-License-Identifier: Apache-2.0
"""A service that counts what reaches it, and gets into every state from which one must end."""

from __future__ import annotations

import itertools
import os
import signal
import sys
import time
from contextlib import suppress

from bus_schema import VERSION, keys
from bus_schema.messages import Clock, Forces, WorldObject
from bus_schema.rpc import Done, Empty, Take, Taken
from mobee.robot.load import load_robot
from services.common import service as life
from services.common.config import load_config
from services.common.entry import explained
from services.common.service import CallRefused, Service
from tests.services.common.probe_config import Config

WHO = "probe"


class Probe:
    def __init__(self, service: Service, config: Config) -> None:
        self.service, self.numbers = service, dict.fromkeys(("takes", "objects", "forces", "clocks", "runs", "marks", "k"), 0)
        self._epochs = itertools.count(1)
        service.describe = lambda: ("a probe", {**self.numbers, "waiting": service.inbox.dropped})
        service.mark = lambda: self._count("marks")
        service.on_request(keys.goal("*", "take"), Take, lambda request, _: self._take(request), part_of_key=True)
        service.on_request(keys.service_rpc(WHO, "fail"), Empty, self._fail)
        service.on_request(keys.service_rpc(WHO, "block"), Empty, self._block)
        service.on_request(keys.service_rpc(WHO, "lose"), Empty, self._lose)
        service.on_each(WorldObject, lambda _: self._see(config.inject_test_delay))
        service.on_newest(Forces, lambda _: self._count("forces"), "model")
        service.on_clock(self._tick)
        service.on_run(lambda: self._count("runs"))

    def _count(self, name: str) -> None:
        self.numbers[name] += 1

    def _see(self, inject_test_delay: float) -> None:
        time.sleep(inject_test_delay)
        self._count("objects")

    def _tick(self, clock: Clock) -> None:
        self._count("clocks")
        self.numbers["k"] = clock.k

    def _take(self, request: Take) -> Taken:
        if request.instance == "nobody":
            raise CallRefused("token", "no such token")
        self._count("takes")
        return Taken(v=VERSION, epoch=next(self._epochs))

    def _fail(self, request: Empty, key: str) -> Done:
        raise RuntimeError("the probe is broken")

    def _block(self, request: Empty, key: str) -> Done:
        self.service.inbox.at(time.monotonic() + 0.05, self._ask_the_mute)
        return Done(v=VERSION)

    def _lose(self, request: Empty, key: str) -> Done:
        with suppress(SystemExit):  # as Python does with what is raised in a finalizer
            os.kill(os.getpid(), signal.SIGTERM)
            time.sleep(1.0)
        return Done(v=VERSION)

    def _ask_the_mute(self) -> None:
        print("blocked", file=sys.stderr, flush=True)
        self.service.call("mute/rpc/never", Empty, Done, timeout=60.0)


def main() -> None:
    config = load_config(Config, None, WHO)
    life.ORPHANED = config.orphaned
    print("connecting", file=sys.stderr, flush=True)
    with explained(WHO), Service(WHO, config, load_robot(config.robot)) as service:
        Probe(service, config)
        service.ready()
        service.run()


if __name__ == "__main__":
    main()
