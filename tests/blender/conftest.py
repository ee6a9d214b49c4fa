"""The add-on enabled, and a file to work in."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import bpy
import pytest

from tests.addon import MODULE, ball_before_camera

# isort: split
import addon_utils  # Blender's own, there once bpy is imported


@pytest.fixture(scope="module")
def addon() -> Iterator[None]:
    """Enable the add-on for this file."""
    assert addon_utils.enable(MODULE) is not None
    yield
    addon_utils.disable(MODULE)


@pytest.fixture
def scene(addon: None, tmp_path: Path) -> bpy.types.Scene:
    """Open a file with a sphere before a camera, saved, and settings for a small capture."""
    return ball_before_camera(tmp_path / "work.blend")
