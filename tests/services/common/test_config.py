# SPDX-License-Identifier: Apache-2.0
"""A mistake in a configuration is one line that says where it is and what would be right; exit code 2."""

from __future__ import annotations

from pathlib import Path

import pytest

from services.common.config import load_config
from tests.services.common.probe_config import Config


def write(folder: Path, text: str) -> str:
    file = folder / "settings.toml"
    file.write_text(text)
    return str(file)


def complaint(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    with pytest.raises(SystemExit) as caught:
        load_config(Config, arguments, "probe")
    assert caught.value.code == 2
    return capsys.readouterr().err


def line(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> str:
    text = complaint(arguments, capsys).rstrip("\n")
    assert "\n" not in text
    assert text.startswith("probe: ")
    return text


def test_defaults_need_nothing() -> None:
    assert load_config(Config, [], "probe") == Config()


def test_a_file_overrides_defaults_and_flags_override_the_file(tmp_path: Path) -> None:
    file = write(tmp_path, 'seed = 7\ngains = "published_2014"\nshare = 1\n[posture]\nhead = [0.1, 2]\n')
    config = load_config(Config, ["--seed", "9", "--config", file, "--robot", "icub_2014"], "probe")
    assert config == Config(seed=9, robot="icub_2014", gains="published_2014", share=1.0, posture={"head": [0.1, 2.0]})


def test_the_file_may_be_given_with_an_equals_sign_and_the_help_speaks_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert load_config(Config, [f"--config={write(tmp_path, 'seed = 7')}"], "probe").seed == 7
    with pytest.raises(SystemExit) as caught:
        load_config(Config, ["--help"], "probe")
    assert caught.value.code == 0
    assert "--config FILE" in capsys.readouterr().out


def test_an_unknown_field_is_refused_with_file_line_and_nearest_name(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, "# settings\nseed = 1\ninject_test_dealy = 2.0\n")
    text = line(["--config", file], capsys)
    assert f"{file}:3: " in text
    assert "'inject_test_dealy'" in text
    assert "Did you mean 'inject_test_delay'?" in text


@pytest.mark.parametrize(
    ("wrong", "field", "says"),
    [
        ('seed = "one"', "seed", "Expected a whole number, got a text"),
        ("seed = -1", "seed", ">= 0"),
        ("share = 0.0", "share", "> 0"),
        ("share = 2.0", "share", "<= 1"),
        ("share = nan", "share", "> 0"),
        ('gains = "defualt"', "gains", "Did you mean 'default'?"),
        ("posture = 3", "posture", "Expected a table, got a whole number"),
    ],
)
def test_a_wrong_value_is_refused_with_file_line_and_field(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], wrong: str, field: str, says: str
) -> None:
    file = write(tmp_path, f"robot = 'icub'\n\n{wrong}\n")
    text = line(["--config", file], capsys)
    assert f"{file}:3: {field}" in text
    assert says in text


def test_a_wrong_value_in_a_table_is_refused_with_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = write(tmp_path, "seed = 1\n[posture]\ntorso = [0.0]\nhead = ['up']\n")
    text = line(["--config", file], capsys)
    assert f"{file}:2: posture" in text  # of the table: which of its entries is wrong msgspec does not say
    assert "Expected a number, got a text" in text


def test_a_file_that_is_no_toml_is_refused_with_its_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    text = line(["--config", write(tmp_path, "seed = 1\nrobot icub\n")], capsys)
    assert "not TOML" in text
    assert "line 2" in text


def test_a_missing_an_unreadable_and_a_binary_file_are_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "No such file" in line(["--config", str(tmp_path / "none.toml")], capsys)
    assert "Is a directory" in line(["--config", str(tmp_path)], capsys)
    binary = tmp_path / "binary.toml"
    binary.write_bytes(b"seed = \xff\xfe")
    assert "not UTF-8" in line(["--config", str(binary)], capsys)
    assert "--config needs a file" in line(["--config"], capsys)


def test_a_flag_out_of_its_bounds_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert "share" in line(["--share", "3"], capsys)


@pytest.mark.parametrize("arguments", [["--sead", "1"], ["--seed", "one"], ["--gains", "none"]])
def test_a_wrong_flag_ends_with_code_2_and_is_named(capsys: pytest.CaptureFixture[str], arguments: list[str]) -> None:
    assert arguments[0] in complaint(arguments, capsys)
