# SPDX-License-Identifier: Apache-2.0
"""What the tests share: the command of this build, and data sets made once with it."""

from __future__ import annotations

import os
import subprocess
from pathlib import Path

import pytest

import tangere


@pytest.fixture(scope="session")
def command() -> Path:
    """The program of the build whose module is tested: build/*/tangere beside build/*/python."""
    path = Path(os.environ.get("TANGERE_PROGRAM", Path(tangere.__path__[0]).parents[1] / "tangere"))
    assert path.is_file(), f"no program at {path}; build the target tangere or set TANGERE_PROGRAM"
    return path


@pytest.fixture(scope="session")
def generate(command, tmp_path_factory):
    """generate(task or scene, *options) → the folder of a new data set."""

    def run(what: str, *options: str) -> Path:
        folder = tmp_path_factory.mktemp("data") / "set"
        subprocess.run(
            [command, "generate", what, "--output", folder, *options],
            check=True,
            stdin=subprocess.DEVNULL,
            capture_output=True,
        )
        return folder

    return run


@pytest.fixture(scope="session")
def pushes(generate) -> Path:
    """Twenty scripted episodes of box pushing."""
    return generate("box_pushing", "--episodes", "20", "--seed", "5")
