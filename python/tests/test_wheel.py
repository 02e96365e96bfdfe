# SPDX-License-Identifier: Apache-2.0
"""What `pip wheel` makes is for every machine. `./dev wheel` builds one and tests it whole."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


def test_settings_are_those_of_a_wheel_for_every_machine():
    tomllib = pytest.importorskip("tomllib", reason="Python before 3.11 reads no TOML")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())
    settings = project["tool"]["scikit-build"]
    assert settings["cmake"]["define"]["TANGERE_ISAS"] == "all"
    assert settings["cmake"]["define"]["HDF5_USE_STATIC_LIBRARIES"] == "ON"
    oldest = project["project"]["requires-python"].removeprefix(">=")
    assert settings["wheel"]["py-api"] == "cp" + oldest.replace(".", "")
    assert f"find_package(Python {oldest} " in (ROOT / "python/CMakeLists.txt").read_text()
    pins = (ROOT / "python/requirements.txt").read_text().splitlines()
    assert [p for p in project["build-system"]["requires"] if p.startswith("nanobind==")][0] in pins


def command(folder):
    return subprocess.run(
        [sys.executable, "-S", ROOT / "python/command.py", "generate", "two words"],
        env={"PYTHONPATH": str(folder)}, capture_output=True, text=True,
    )  # fmt: skip


def test_the_command_becomes_the_program_of_the_package(tmp_path):
    missing = command(tmp_path)
    assert missing.returncode == 1 and "expected it beside the package" in missing.stderr
    program = tmp_path / "tangere" / "bin" / "tangere"
    program.parent.mkdir(parents=True)
    program.write_text('#!/bin/sh\nprintf "%s|" "$@"\nexit 7\n')
    program.chmod(0o755)
    found = command(tmp_path)
    assert (found.returncode, found.stdout) == (7, "generate|two words|")
