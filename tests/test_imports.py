"""Who may import what: the table of the layers, checked in the source of every file."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
NUMERIC = {"numpy", "scipy", "numba", "OpenEXR"}
BLENDER = {"bpy", "bmesh", "mathutils", "bpy_extras", "OpenImageIO"}  # the last one comes inside bpy

# Folder -> packages from outside that its files may import, folders of ours that they may reach.
LAYERS: dict[str, tuple[set[str], set[str]]] = {
    "pipeline/core": (NUMERIC, {"pipeline/core"}),
    "pipeline/blender": (
        NUMERIC | BLENDER | {"rawpy", "embreex", "h5py", "cv2"},
        {"pipeline/core", "pipeline/blender"},
    ),
    "pipeline/commands": (
        NUMERIC | {"bpy", "typer", "rich", "distributed"},
        {"pipeline/core", "pipeline/blender", "pipeline/report", "pipeline/commands"},
    ),
    "pipeline/report": (NUMERIC | {"matplotlib", "flip_evaluator"}, {"pipeline/core", "pipeline/report"}),
    "scenes": ({"numpy"} | BLENDER, {"scenes"}),
    "blender_addon": ({"bpy", "bpy_extras", "gpu", "gpu_extras", "mathutils"}, {"blender_addon", "pipeline"}),
}


def files_of(folder: str) -> list[Path]:
    return sorted((ROOT / folder).rglob("*.py"))


def imports(path: Path, source: str) -> Iterator[tuple[str, str]]:
    """Yield ``("outside", package)`` and ``("ours", path of the imported file or folder)`` for one file."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (("outside", name.name.partition(".")[0]) for name in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            yield "outside", (node.module or "").partition(".")[0]
        elif isinstance(node, ast.ImportFrom):
            base = path.parents[node.level - 1].joinpath(*(node.module or "").split("."))
            names = [base] if node.module else [base / name.name for name in node.names]
            yield from (("ours", name.relative_to(ROOT).as_posix()) for name in names)


def faults(path: Path, source: str, folder: str) -> list[str]:
    """Return what a file imports against the table."""
    packages, reachable = LAYERS[folder]
    found = []
    for kind, name in imports(path, source):
        if kind == "outside" and name not in packages and name not in sys.stdlib_module_names:
            found.append(f"{path.relative_to(ROOT)} imports {name}")
        if kind == "ours" and not any(name == r or name.startswith(f"{r}/") for r in reachable):
            found.append(f"{path.relative_to(ROOT)} reaches {name}")
    return found


@pytest.mark.parametrize("folder", LAYERS)
def test_every_file_keeps_to_the_table(folder: str) -> None:
    files = files_of(folder)
    assert files
    assert [fault for path in files for fault in faults(path, path.read_text(encoding="utf-8"), folder)] == []


@pytest.mark.parametrize(
    ("folder", "source"),
    [
        ("pipeline/core", "import bpy"),
        ("pipeline/core", "def f():\n    from mathutils import Vector"),
        ("pipeline/core", "from ..blender import scene"),
        ("pipeline/core", "from pipeline.core import images"),
        ("pipeline/core", "import torch"),
        ("pipeline/blender", "from ..commands import stage"),
        ("pipeline/blender", "import typer"),
        ("pipeline/blender", "import matplotlib"),
        ("pipeline/report", "import bpy"),
        ("blender_addon", "import numpy as np"),
        ("scenes", "from ..pipeline.core import images"),
    ],
)
def test_a_forbidden_import_is_found(folder: str, source: str) -> None:
    assert faults(ROOT / folder / "example.py", source, folder)


def test_the_extension_entry_imports_nothing() -> None:
    body = ast.parse((ROOT / "__init__.py").read_text(encoding="utf-8")).body
    assert not [node for node in body if isinstance(node, ast.Import | ast.ImportFrom)]


def test_help_does_not_wait_for_blender() -> None:
    code = "import sys; from pipeline import cli; print(sorted({'bpy', 'OpenEXR', 'matplotlib'} & set(sys.modules)))"
    found = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
