# SPDX-License-Identifier: Apache-2.0
from __future__ import annotations

import contextlib
import json
import signal
import subprocess
import sys
from pathlib import Path
from typing import Any, NoReturn

import pytest

import services.monitor.viewer.view
from mobee_cli import bench, check, roadmap, robots, topic
from mobee_cli.__main__ import VERBS, main
from tests.services.launcher.launched import mobee


def test_without_a_verb_all_verbs_are_listed(capsys: pytest.CaptureFixture[str]) -> None:
    assert main([]) == 0
    usage = capsys.readouterr().out
    assert all(f"  {verb} " in usage for verb in VERBS)


def test_an_unknown_verb_names_the_nearest(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["lanch"]) == 2
    assert capsys.readouterr().err.startswith("mobee: unknown verb 'lanch'. Did you mean 'launch'?")


ACTIONS = {
    "topic": ("list", "echo", "hz", "schema"),
    "roadmap": tuple(roadmap.ACTIONS),
    "experiment": ("list", "run", "figure", "claims"),
    "bench": tuple(bench.BENCHES),
    "detector": ("train",),
}


@pytest.mark.parametrize("words", [[verb, *action] for verb in VERBS for action in [[], *([name] for name in ACTIONS.get(verb, ()))]])
def test_every_verb_and_action_has_help_that_fits_80_columns(
    words: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit) as ended:
        main([*words, "--help"])
    assert ended.value.code == 0
    text = capsys.readouterr().out
    assert f"usage: mobee {' '.join(words)}" in text
    assert [line for line in text.splitlines() if len(line) > 80] == []


@pytest.mark.parametrize(
    "arguments", [["status", "--jsn"], ["topic", "lst"], ["topic", "hz"], ["launch", "--duration", "-1"], ["launch", "--duration", "soon"]]
)
def test_a_wrong_option_is_refused_in_one_line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit) as ended:
        main(arguments)
    assert ended.value.code == 2
    said = capsys.readouterr().err
    assert len(said.splitlines()) == 1
    assert said.startswith(f"mobee {arguments[0]}")
    assert " _" not in said  # no name of our own code


@pytest.mark.parametrize("verb", [["status"], ["stop"], ["estop"], ["estop", "--reset"], ["topic", "list"], ["topic", "echo", "clock"]])
def test_with_nothing_running_it_says_how_to_start(verb: list[str], free_port: int, capsys: pytest.CaptureFixture[str]) -> None:
    endpoint = f"tcp/127.0.0.1:{free_port}"
    assert main([*verb, "--endpoint", endpoint]) == 3
    said = capsys.readouterr().err
    assert f"no router at {endpoint}" in said
    assert "Start it with `mobee launch`" in said
    assert len(said.splitlines()) == 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="this system has no /dev/full")
@pytest.mark.parametrize("words", [["robots"], ["--help"]])
def test_output_that_cannot_be_written_is_said_in_one_line(words: list[str]) -> None:
    with open("/dev/full", "w") as full:
        done = subprocess.run([sys.executable, "-m", "mobee_cli", *words], stdout=full, stderr=subprocess.PIPE, text=True)
    assert done.returncode == 3
    assert done.stderr == f"mobee {words[0]}: a file or the output cannot be read or written (No space left on device)\n"


def test_an_error_of_the_system_is_said_in_one_line(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    def run(_: Any) -> int:
        print("the result")
        raise PermissionError(13, "Permission denied", "a.png")

    monkeypatch.setattr(robots, "run", run)
    assert main(["robots"]) == 3
    assert capsys.readouterr() == ("the result\n", "mobee robots: a.png cannot be read or written (Permission denied)\n")


def interrupt(*_: Any, **__: Any) -> NoReturn:
    raise KeyboardInterrupt


@pytest.mark.parametrize(("module", "arguments"), [(check, ["check", "icub"]), (bench, ["bench", "model"]), (robots, ["robots"])])
def test_ctrl_c_is_no_success(
    module: Any, arguments: list[str], monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(module, "run", interrupt)
    assert main(arguments) == 130
    assert capsys.readouterr().err == f"mobee {arguments[0]}: interrupted\n"


@pytest.mark.parametrize(("arguments", "code"), [(["echo", "clock"], 0), (["hz", "clock"], 0), (["list"], 130)])
def test_ctrl_c_ends_a_verb_without_an_end(arguments: list[str], code: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(topic, "connected", lambda _: contextlib.nullcontext())
    monkeypatch.setattr(topic, "listen", interrupt)
    assert main(["topic", *arguments]) == code


def test_ctrl_c_ends_a_page_but_breaks_off_a_recording(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(services.monitor.viewer.view, "view", interrupt)
    assert main(["view", "katana"]) == 0
    assert main(["view", "katana", "--save", str(tmp_path / "katana.rrd")]) == 130


def test_sigterm_interrupts_a_verb_so_that_what_it_has_started_ends() -> None:
    code = (
        "import os, signal, sys, mobee_system\nfrom mobee_cli import robots\n"
        "def run(_):\n    try: os.kill(os.getpid(), signal.SIGTERM); signal.pause()\n    finally: print('ended')\n"
        "robots.run = run\nsys.argv = ['mobee', 'robots']\nsys.exit(mobee_system.main())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "ended\n", "mobee robots: interrupted\n")


def test_ctrl_c_during_the_imports_prints_no_traceback() -> None:
    code = (
        "import builtins, os, signal, mobee_system\nreal = builtins.__import__\n"
        "def interrupted(name, *given, **named):\n"
        "    if name.startswith('mobee_cli'): os.kill(os.getpid(), signal.SIGINT)\n"
        "    return real(name, *given, **named)\n"
        "builtins.__import__ = interrupted\nmobee_system.main()"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (-signal.SIGINT, "")


def test_the_command_itself_imports_nothing_heavy() -> None:
    code = (
        "import sys, mobee_cli.__main__ as m; m.main([]); "
        "print(sorted({'numpy', 'zenoh', 'msgspec', 'tyro', 'mobee'} & set(sys.modules)), file=sys.stderr)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stderr.strip() == "[]"


def test_the_verbs_of_an_operator_import_no_library() -> None:
    code = "import sys, mobee_cli.status, mobee_cli.stop, mobee_cli.estop, mobee_cli.topic; print('numpy' in sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.strip() == "False"


def test_robots_lists_the_shipped_files() -> None:
    done = mobee("robots")
    assert done.returncode == 0
    assert "icub         41 motors: torso 3, head 6, left_arm 16, right_arm 16" in done.stdout
    assert "table" in done.stdout


def test_the_schema_of_a_key_needs_no_running_system(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["topic", "schema", "left_arm/state"]) == 0
    assert json.loads(capsys.readouterr().out)["message"]["$ref"] == "#/$defs/State"
    assert main(["topic", "schema"]) == 0
    assert "{part}/rpc/drive/take" in capsys.readouterr().out.splitlines()
    assert main(["topic", "schema", "{part}/stat"]) == 2
    assert "no message of the bus has the key '{part}/stat'. Did you mean '{part}/state'?" in capsys.readouterr().err
