"""The properties of this folder once more, on a thousand examples each: more than ten thousand in all."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.slow
def test_properties_hold_on_many_thousand_examples() -> None:
    command = [sys.executable, "-m", "pytest", "-q", "--hypothesis-profile=thorough", str(Path(__file__).parent)]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-4000:]
