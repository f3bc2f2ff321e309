# SPDX-License-Identifier: Apache-2.0
"""A client that uses Zenoh and msgpack only: it reads a stream, makes a call, and lists which services are alive.

It imports no package of this project, so the same lines can be written in any language that has Zenoh. `mobee topic schema KEY` prints
the fields of each message. It needs a running system, such as `mobee launch kinematic --headless`; `--endpoint` names its address.
"""

from __future__ import annotations

import argparse
import json
import time
import uuid
from typing import Any

import msgspec  # for msgpack alone: the package msgpack does as well
import zenoh

VERSION = 8  # of the contract: it stands in every message, request and encoding string
NAMESPACE = "icub"  # prefix of all keys
SECONDS = 1.0


def connect(endpoint: str) -> zenoh.Session:
    """Open a session with the router of the running system."""
    config = zenoh.Config()
    for path, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "namespace": NAMESPACE,
    }.items():
        config.insert_json5(path, json.dumps(value))
    return zenoh.open(config)


def call(session: zenoh.Session, key: str, request: str = "Empty", **fields: Any) -> dict[str, Any]:
    """Send a request to a service and return the fields of its reply as a dict.

    `key`: key of the call. `request`: name of the request's type. `fields`: its fields, besides the header (version, id, caller). Raises
    SystemExit if the service refuses the call, or no service answers within 2 s.
    """
    header = {"v": VERSION, "id": uuid.uuid4().hex, "who": "bare_client"}
    encoding = f"application/msgpack;icub/{request}/{VERSION}"
    for answer in session.get(key, payload=msgspec.msgpack.encode(header | fields), encoding=encoding, timeout=2.0):
        if answer.ok is None:
            raise SystemExit(f"{key}: {answer.err and msgspec.msgpack.decode(answer.err.payload.to_bytes())}")
        return dict(msgspec.msgpack.decode(answer.ok.payload.to_bytes()))
    raise SystemExit(f"{key}: no service answers")


def main(endpoint: str) -> None:
    """Print the services that are alive, the motors of a part, and their positions for a second."""
    with connect(endpoint) as session:
        alive = [str(token.ok.key_expr).split("/")[1] for token in session.liveliness().get("alive/*/*") if token.ok is not None]
        print(f"alive: {', '.join(sorted(alive))}")
        meta = call(session, "left_arm/meta")
        print(f"left_arm of {meta['robot']}: {len(meta['motors'])} motors, the first is {meta['motors'][0]}")
        states: list[dict[str, Any]] = []
        session.declare_subscriber("left_arm/state", lambda sample: states.append(msgspec.msgpack.decode(sample.payload.to_bytes())))
        time.sleep(SECONDS)
        if not states:
            raise SystemExit("no state of the left arm arrived")
        newest = states[-1]
        print(f"tick {newest['k']}: gate {newest['gate']}, {meta['motors'][0]} at {newest['q'][0]:.3f} rad; {len(states)} states in 1 s")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--endpoint", default="tcp/127.0.0.1:7447", help="router of the running system (default: %(default)s)")
    try:
        main(parser.parse_args().endpoint)
    except zenoh.ZError:
        raise SystemExit("no system runs at this endpoint: start one with `mobee launch kinematic --headless`") from None
