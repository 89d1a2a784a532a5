"""Stubs say what the extension has, and examples have no error of types."""

import subprocess
import sys
from pathlib import Path

import pytest


def test_examples_have_no_error_of_types(tmp_path):
    pytest.importorskip("mypy")
    examples = sorted(map(str, (Path(__file__).parent.parent / "examples").glob("*.py")))
    options = ["--strict", "--ignore-missing-imports", "--no-warn-unused-ignores", "--cache-dir", str(tmp_path)]
    command = [sys.executable, "-m", "mypy", *options, *examples]
    found = subprocess.run(command, capture_output=True, text=True)
    assert found.returncode == 0, found.stdout


def test_stubs_are_right():
    pytest.importorskip("mypy")
    command = [sys.executable, "-m", "mypy.stubtest", "energy_dsl._energy"]
    found = subprocess.run(command, capture_output=True, text=True, cwd=Path(__file__).parent)
    assert found.returncode == 0, found.stdout
