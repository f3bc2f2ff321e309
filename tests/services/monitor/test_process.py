# SPDX-License-Identifier: Apache-2.0
"""The monitor as a process: the logged data, and that it disturbs no other process."""

from __future__ import annotations

import os
import resource
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import psutil
import pytest

from bus_schema import VERSION, decode, keys
from bus_schema.messages import Clock, ContactItem, Contacts, Event, Forces, Geometry, Image, Motion, State, Transition, Truth, WorldObject
from bus_schema.rpc import ObjectState
from mobee.model.kinematics import link_transforms
from mobee.robot.load import load_robot
from mobee.robot.robot import Shape, ShapeKind
from services.common.observe import listen
from tests.services.robots import ARM
from tests.services.stage import LOOKING_DOWN, Stage, posture

rr = pytest.importorskip("rerun")
from mobee.rendering import palette  # noqa: E402  # only where Rerun is
from mobee.rendering.solid import BUDGET  # noqa: E402  # only where Rerun is
from services.monitor.viewer.blueprint import blueprint, shown_of  # noqa: E402  # only where Rerun is
from services.monitor.viewer.files import program  # noqa: E402  # only where Rerun is
from services.monitor.viewer.plots import Plots  # noqa: E402  # only where Rerun is
from services.monitor.viewer.scene import FIELD_PATHS, Scene  # noqa: E402  # only where Rerun is
from services.monitor.web.record import entries  # noqa: E402  # only where Rerun is

ROBOT = load_robot("icub")
DOWN = posture(ROBOT, LOOKING_DOWN)


@pytest.fixture
def stage(free_port: int) -> Iterator[Stage]:
    made = Stage(free_port)
    yield made
    made.close()


@pytest.fixture
def web_port() -> int:
    """A free port of loopback."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


class Notebook:
    """A recording stream that stores the logged data."""

    def __init__(self) -> None:
        self.stream = rr.RecordingStream("test")
        self.logged: dict[str, list[Any]] = {}
        self.stream.log = self._log

    def _log(self, path: str, *what: Any, static: bool = False) -> None:
        self.logged.setdefault(path, []).extend(what)


def channels(shape: Any) -> list[tuple[int, int, int, int]]:
    packed = [int(value) for value in shape.colors.as_arrow_array().to_pylist()]
    return [(value >> 24, value >> 16 & 255, value >> 8 & 255, value & 255) for value in packed]


def test_a_capsule_of_the_world_is_drawn_as_one() -> None:
    notebook = Notebook()
    turn = [0.5**0.5, 0.0, 0.5**0.5, 0.0]  # z to x
    pole = ObjectState("pole", Geometry("capsule", [0.1, 0.4]), position=[1.0, 0.0, 0.0], quaternion=turn, role="obstacle", link="")
    Scene(notebook.stream, ROBOT).set_objects([pole])
    capsule = notebook.logged["scene/objects/pole"][-1]
    assert isinstance(capsule, rr.Capsules3D)
    np.testing.assert_allclose(capsule.translations.as_arrow_array().to_pylist(), [[0.8, 0.0, 0.0]], atol=1e-6)


def test_a_field_is_red_while_it_is_in_contact() -> None:
    notebook = Notebook()
    scene = Scene(notebook.stream, ROBOT)
    capsules = [shape.name for shape in ROBOT.shapes if shape.role == "field" and shape.kind == "capsule"]
    touching = ContactItem(
        first=capsules[3], second="table", kind="field", depth=0.01, point=[0.0] * 3, normal=[0.0, 0.0, 1.0], first_link=0, second_link=-1
    )
    scene.log_robot(DOWN, [touching])
    scene.log_robot(DOWN, [])
    shown = [item for item in notebook.logged["scene/fields/capsules"] if isinstance(item, rr.Capsules3D)]
    assert channels(shown[0]) == [palette.TOUCHED if name == capsules[3] else palette.FIELD for name in capsules]
    assert set(channels(shown[1])) == {palette.FIELD}


def test_fields_of_every_kind_are_drawn_and_move_as_their_links_do() -> None:
    sizes: dict[ShapeKind, tuple[float, ...]] = {
        "sphere": (0.1,),
        "capsule": (0.1, 0.4),
        "cylinder": (0.1, 0.4),
        "box": (0.1, 0.2, 0.3),
        "convex": (),
    }
    place, turn = np.array([0.1, 0.2, 0.3]), np.array([[0.0, 0.0, 1.0], [0.0, 1.0, 0.0], [-1.0, 0.0, 0.0]])
    cube = np.array([[x, y, z] for x in (-0.1, 0.1) for y in (-0.1, 0.1) for z in (-0.1, 0.1)])
    hand = ROBOT.links.index("l_hand")
    made = [
        Shape(f"field_{kind}", hand, kind, size, place, turn, "field", "left_arm", cube if kind == "convex" else None)
        for kind, size in sizes.items()
    ]
    notebook = Notebook()
    scene = Scene(notebook.stream, replace(ROBOT, shapes=tuple(made)))
    scene.log_robot(DOWN, [])
    scene.show_fields(False)
    scene.log_robot(DOWN, [])
    link = link_transforms(ROBOT, DOWN)[hand]
    centre = link[:3, :3] @ place + link[:3, 3]
    for kind, path in FIELD_PATHS.items():
        _, shown, hidden = notebook.logged[path]
        name = {"box": "centers", "sphere": "centers", "cylinder": "centers", "capsule": "translations", "convex": "vertex_positions"}[kind]
        points = np.array(getattr(shown, name).as_arrow_array().to_pylist())
        if kind == "convex":
            local = (points - centre) @ link[:3, :3] @ turn
            np.testing.assert_allclose(np.abs(local), 0.1, atol=1e-6)
            assert len(shown.triangle_indices.as_arrow_array()) == 12
        else:
            start = link[:3, :3] @ turn[:, 2] * 0.2 if kind == "capsule" else 0.0
            np.testing.assert_allclose(points, [centre - start], atol=1e-6)
        assert len(getattr(hidden, name).as_arrow_array()) == 0


def test_a_robot_without_meshes_is_drawn_by_its_solids_which_move_as_its_links_do(tmp_path: Path) -> None:
    (tmp_path / "arm.xml").write_text(ARM)
    robot = load_robot(tmp_path / "arm.xml")
    notebook = Notebook()
    scene = Scene(notebook.stream, robot)
    q = np.array([0.5, -0.3])
    scene.log_robot(q, [])
    transforms = link_transforms(robot, q)
    for shape in robot.shapes:
        frame, body = notebook.logged[f"/robot/links/{robot.links[shape.link]}/volume_0"]
        assert isinstance(frame, rr.CoordinateFrame) and isinstance(body, rr.Cylinders3D)
        (place,) = notebook.logged[f"robot/frames/link_{shape.link}"]
        np.testing.assert_allclose(place.translation.as_arrow_array().to_pylist(), [transforms[shape.link, :3, 3]], atol=1e-6)


def test_the_page_shows_the_parts_of_any_robot(tmp_path: Path) -> None:
    assert palette.colors_of(ROBOT.parts) == palette.PARTS
    assert list(palette.colors_of(["legs", "tail", "arm", "gripper"])) == ["legs", "tail", "arm"]
    (tmp_path / "arm.xml").write_text(ARM)
    robot = load_robot(tmp_path / "arm.xml")
    shown = shown_of(robot)
    assert (shown.name, shown.parts) == ("arm", ("arm",))
    assert blueprint(shown).root_container is not None
    notebook = Notebook()
    Plots(notebook.stream, robot)
    assert {path.removeprefix("plots/") for path in notebook.logged} == {
        "forces",
        "joints/arm",
        "reward/arm",
        "value/arm",
        "transitions/arm",
    }


def test_the_plot_of_forces_has_all_published_terms() -> None:
    """Those of the law from the beginning, those from outside as soon as the controller publishes them."""
    notebook = Notebook()
    plots = Plots(notebook.stream, ROBOT)
    header = {"v": VERSION, "run": "r", "src": "s", "seq": 0, "k": 1, "t": 0, "tw": 0, "re_k": 1, "part_age": {}, "touched": {}}
    plots.log_forces(Forces(**header, terms={"limits": [3.0, 4.0], "constraints": [0.0, 0.0], "collision": [1.0, 0.0]}))
    plots.log_forces(Forces(**header, terms={"viscous": [0.0, -2.0]}))
    logged = notebook.logged["plots/forces"]
    styles = [style.names.as_arrow_array().to_pylist() for style in logged if isinstance(style, rr.SeriesLines)]
    scalars = [one.scalars.as_arrow_array().to_pylist() for one in logged if isinstance(one, rr.Scalars)]
    assert styles == [["limits", "constraints", "collision"], ["limits", "constraints", "collision", "viscous"]]
    assert scalars == [[5.0, 0.0, 1.0], [5.0, 0.0, 1.0, 2.0]]


def test_the_icub_is_drawn_as_its_meshes_a_mesh_a_link_within_the_budget() -> None:
    notebook = Notebook()
    scene = Scene(notebook.stream, ROBOT)
    meshes = {path.split("/")[3]: found[1] for path, found in notebook.logged.items() if path.endswith("/mesh")}
    assert {"root_link", "chest", "head", "l_forearm", "r_forearm"} <= meshes.keys()
    assert 40_000 < sum(len(body.triangle_indices.as_arrow_array()) for body in meshes.values()) <= 1.01 * BUDGET
    corners = np.array(meshes["head"].vertex_positions.as_arrow_array().to_pylist())
    eye = ROBOT.marker("left_eye").position
    assert (corners.min(axis=0) < eye).all() and (eye < corners.max(axis=0)).all()
    scene.log_robot(DOWN, [])
    (place,) = notebook.logged[f"robot/frames/link_{ROBOT.links.index('head')}"]
    at = link_transforms(ROBOT, DOWN)[ROBOT.links.index("head"), :3, 3]
    np.testing.assert_allclose(place.translation.as_arrow_array().to_pylist(), [at], atol=1e-6)


def test_trails_follow_the_hands_and_end_with_the_run() -> None:
    notebook = Notebook()
    scene = Scene(notebook.stream, ROBOT)
    for lift in np.linspace(0.0, 40.0, 24):
        scene.log_robot(posture(ROBOT, {**LOOKING_DOWN, "l_shoulder_roll": 20.0 + lift}), [])
    points = newest_trails(notebook)
    assert np.ptp(points[points[:, 1] < 0.0], axis=0).max() > 0.1  # the left hand has moved, the right one has not
    assert np.ptp(points[points[:, 1] > 0.0], axis=0).max() < 0.01
    scene.forget()
    for _ in range(4):
        scene.log_robot(DOWN, [])
    points = newest_trails(notebook)
    assert np.ptp(points[points[:, 1] < 0.0], axis=0).max() < 0.01


def newest_trails(notebook: Notebook) -> Any:
    last = [item for item in notebook.logged["scene/trails"] if isinstance(item, rr.LineStrips3D)][-1]
    return np.vstack([np.array(strip) for strip in last.strips.as_arrow_array().to_pylist()])


def whole_chain(stage: Stage) -> Callable[[], None]:
    """A function that puts one message on every stream that the monitor shows."""
    motions = {part: stage.publisher(Motion, part) for part in palette.PARTS}
    forces, contacts = stage.publisher(Forces, "model"), stage.publisher(Contacts)
    images = {eye: stage.publisher(Image, eye) for eye in ("left", "right")}
    transitions = {part: stage.publisher(Transition, part) for part in palette.PARTS}
    ball, events = stage.publisher(WorldObject, "ball"), stage.publisher(Event, "stage")

    def put() -> None:
        for part, stream in motions.items():
            at = [0.1] * len(ROBOT.part(part))
            about = {"action_id": "a", "epoch": 1, "status": "moving", "since_k": 0, "start_k": 0, "touched": []}
            stream.put(**about, q=at, dq=at, ddq=at, goal=at)
        zeros = [0.0] * len(ROBOT.motors)
        forces.put(re_k=stage.k, terms={"limits": zeros, "collision": zeros}, part_age={}, touched={})
        contacts.put(re_k=stage.k, contacts=[])
        for eye, stream in images.items():
            stream.put(camera=eye, k_capture=stage.k, width=16, height=12, encoding="rgb8", data=bytes(16 * 12 * 3))
        for part, stream in transitions.items():
            counts = {"n": 1, "s": 0, "a": 0, "goal": 1, "s_next": 1}
            stream.put(agent=part, **counts, reward=0.5, value=1.0, probability=0.5, settled=True, duration=4.0, touched=[])
        pose = {"position": [-0.35, 0.0, -0.07], "quaternion": [1.0, 0.0, 0.0, 0.0], "covariance": [0.0] * 9}
        ball.put(name="ball", geometry=Geometry("sphere", [0.03]), **pose, role="target", t_capture=0, valid_until=10**12)
        events.put(level="warning", code="note", text="hello", values={})

    return put


def test_the_recording_holds_everything_there_is_to_see(stage: Stage, tmp_path: Path) -> None:
    put, begin = whole_chain(stage), time.monotonic()
    with stage.running("services.monitor", "monitor", "--no-serve", "--run-dir", str(tmp_path)):

        def busy() -> bool:
            if stage.k % 10 == 0:
                put()
            return stage.k > 150

        assert stage.play(DOWN, busy)
        stat = stage.stat("monitor")
        assert stat.numbers["transitions"] > 0
        assert stat.numbers["updates"] <= 20 * (time.monotonic() - begin)  # 20 Hz at most
    private = {**os.environ, "XDG_CONFIG_HOME": str(tmp_path), "XDG_DATA_HOME": str(tmp_path)}
    command = [program(), "rrd", "stats", str(tmp_path / "recording.rrd")]
    done = subprocess.run(command, capture_output=True, text=True, check=True, env=private)
    shown = {line.split(":")[0] for line in done.stdout.splitlines() if line.startswith("/")}
    wanted = {
        "/robot/links/head/mesh",
        "/robot/frames/link_6",
        "/scene/fields/capsules",
        "/scene/fields/spheres",
        "/scene/trails",
        "/scene/objects/ball",
        "/events",
    }
    wanted |= {"/eyes/left", "/eyes/right", "/plots/forces", "/plots/reward/torso", "/plots/value/left_arm", "/plots/transitions/right_arm"}
    wanted |= {f"/plots/joints/{part}" for part in palette.PARTS}
    assert wanted - shown == set()
    assert any(path.startswith("/robot/links/l_hand/volume_") for path in shown)  # its fingers move, so it is drawn as its solids


def test_a_full_disk_does_not_end_the_monitor(stage: Stage, tmp_path: Path) -> None:
    said: list[str] = []
    listen(stage.session, Event.stream.key("monitor"), lambda heard: said.append(decode(Event, heard.payload, heard.encoding).text))
    story = tmp_path / "story.jsonl"
    with stage.running("services.monitor", "monitor", "--no-serve", "--run-dir", str(tmp_path)) as monitor:
        assert stage.play(DOWN, lambda: stage.k > 50)
        resource.prlimit(monitor.pid, resource.RLIMIT_FSIZE, (story.stat().st_size + 500, resource.RLIM_INFINITY))
        assert stage.play(DOWN, lambda: "nothing of the page is recorded: File too large" in said)
        full = len(entries(story))
        resource.prlimit(monitor.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        assert stage.play(DOWN, lambda: "the page is recorded again" in said)
        assert monitor.poll() is None
    assert len(entries(story)) > full


def test_the_page_says_that_a_service_has_ended(stage: Stage, tmp_path: Path) -> None:
    def statuses() -> list[dict[str, Any]]:
        return [one.value for one in entries(tmp_path / "story.jsonl") if one.name == "status"]

    def titles() -> list[str]:
        return [status["banner"]["title"] for status in statuses() if status["banner"]]

    wanted: list[str] = []
    tokens = {who: stage.session.liveliness().declare_token(keys.alive(who, "i")) for who in ("robot_sim", "controller", "agent_torso")}
    with stage.running("services.monitor", "monitor", "--no-serve", "--run-dir", str(tmp_path)):
        assert stage.play(DOWN, lambda: any(status["agents"] == ["torso"] for status in statuses()))
        tokens["agent_torso"].undeclare()
        assert stage.play(DOWN, lambda: statuses()[-1]["agents"] == [])
        for who, title in (("controller", "The controller is gone"), ("robot_sim", "The robot is gone")):
            assert title not in titles()
            tokens[who].undeclare()
            wanted.append(title)
            assert stage.play(DOWN, lambda: wanted[-1] in titles())


def test_the_page_is_served_on_loopback_only_and_nothing_but_events_is_published(stage: Stage, web_port: int) -> None:
    published: set[str] = set()
    with stage.running("services.monitor", "monitor", "--web-port", str(web_port)) as monitor:
        watch = stage.session.declare_subscriber("**", lambda sample: published.add(str(sample.key_expr)))
        assert stage.play(DOWN, lambda: stage.k > 100)
        with urllib.request.urlopen(f"http://127.0.0.1:{web_port}/", timeout=30.0) as answer:
            assert b"<html" in answer.read(2000).lower()
        own = [c for c in psutil.Process(monitor.pid).net_connections("tcp") if c.status == psutil.CONN_LISTEN]
        assert {(c.laddr.ip, c.laddr.port) for c in own} == {("127.0.0.1", web_port)}
        watch.undeclare()
    others = {Clock.stream.key(), Truth.stream.key()} | {State.stream.key(part) for part in ROBOT.parts}
    assert published - others <= {Event.stream.key("monitor")}


def test_browsers_that_do_not_read_do_not_stop_the_monitor(stage: Stage, web_port: int) -> None:
    with stage.running("services.monitor", "monitor", "--web-port", str(web_port)) as monitor:
        assert stage.play(DOWN, lambda: stage.k > 50)
        deaf = []
        for path in ("/frame?after=0", "/news?after=0&page=a", "/frame?after=0", "/news?after=0&page=b"):
            deaf.append(socket.create_connection(("127.0.0.1", web_port)))
            deaf[-1].sendall(f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode())
        try:
            assert stage.play(DOWN, lambda: stage.k > 150, 30.0)
            before, memory = stage.stat("monitor").numbers["updates"], psutil.Process(monitor.pid).memory_info().rss
            assert stage.play(DOWN, lambda: stage.k > 550, 30.0)
            assert stage.stat("monitor").numbers["updates"] - before > 20
            assert psutil.Process(monitor.pid).memory_info().rss - memory < 50_000_000
        finally:
            for one in deaf:
                one.close()


def wait_until_gone(stage: Stage) -> None:
    give_up = time.monotonic() + 20.0
    while stage.is_up("monitor"):
        assert time.monotonic() < give_up
        time.sleep(0.05)


def test_a_monitor_that_was_killed_is_started_again_with_the_same_address(stage: Stage, web_port: int, tmp_path: Path) -> None:
    flags, addresses = ("--web-port", str(web_port), "--run-dir", str(tmp_path)), []
    for _ in range(2):
        with stage.running("services.monitor", "monitor", *flags) as monitor:
            addresses.append(stage.stat("monitor").text)
            os.kill(monitor.pid, signal.SIGKILL)
            monitor.wait(20.0)
        wait_until_gone(stage)
    assert addresses[0] == addresses[1]
    assert (tmp_path / "page.key").stat().st_mode & 0o077 == 0


def test_a_port_in_use_is_reported_in_one_line_with_the_remedy(free_port: int, web_port: int) -> None:
    with socket.socket() as other:
        other.bind(("127.0.0.1", web_port))
        other.listen()
        command = [sys.executable, "-m", "services.monitor", "--endpoint", f"tcp/127.0.0.1:{free_port}", "--web-port", str(web_port)]
        done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert len(done.stderr.splitlines()) == 1
    assert f"web_port {web_port} is in use" in done.stderr
    assert "mobee stop" in done.stderr


def test_a_missing_run_dir_is_reported(free_port: int, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "services.monitor", "--endpoint", f"tcp/127.0.0.1:{free_port}", "--run-dir", str(tmp_path / "none")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=60)
    assert done.returncode == 2
    assert "is not a folder" in done.stderr
