"""The built zip, installed through Blender's extension system where nothing but Blender is."""

from __future__ import annotations

import importlib.metadata
import os
import re
import subprocess
import sys
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
LINE = {(3, 11): "4.5", (3, 13): "5.2"}[sys.version_info[:2]]

pytestmark = pytest.mark.extension


@pytest.fixture(scope="module")
def archive() -> Path:
    """Return the zip for this Blender and this machine."""
    system = {"linux": "linux-x64", "win32": "windows-x64", "darwin": "macos-arm64"}[sys.platform]
    found = sorted((ROOT / "dist").glob(f"lightsphere-*-blender{LINE}-{system}.zip"))
    assert found, "there is no zip in dist/; run python build_extension.py first"
    return found[-1]


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Make an environment with bpy and what bpy itself requires, linked to this one's; return its Python."""
    folder = tmp_path_factory.mktemp("bare")
    venv.create(folder, symlinks=True)
    (site,) = folder.glob("lib/python*/site-packages")
    for distribution in required_by("bpy"):
        for top in {file.parts[0] for file in distribution.files or () if file.parts[0] != ".."}:
            if top != "__pycache__":
                (site / top).symlink_to(str(distribution.locate_file(top)))
    return folder / "bin" / "python"


def required_by(name: str) -> list[importlib.metadata.Distribution]:
    """Return a distribution and everything here that it requires."""
    found, waiting = {}, [name]
    while waiting:
        current = waiting.pop()
        try:
            distribution = importlib.metadata.distribution(current)
        except importlib.metadata.PackageNotFoundError:  # required on other systems only
            continue
        if distribution.name not in found:
            found[distribution.name] = distribution
            wanted = [text for text in distribution.requires or () if "extra ==" not in text]
            waiting.extend(re.split(r"[^\w.-]", text)[0] for text in wanted)
    return list(found.values())


def test_it_installs_works_and_leaves_nothing(archive: Path, bare: Path, tmp_path: Path) -> None:
    environment = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "PYTHONPATH")}
    environment["BLENDER_USER_RESOURCES"] = str(tmp_path / "blender")
    script = Path(__file__).with_name("installed.py")
    run = subprocess.run(
        [str(bare), str(script), str(archive), str(tmp_path)], env=environment, capture_output=True, text=True
    )
    assert run.returncode == 0 and "USED AND REMOVED" in run.stdout, run.stdout[-3000:] + run.stderr[-3000:]


def test_it_brings_only_what_blender_lacks(archive: Path) -> None:
    names = [name.lower() for name in zipfile.ZipFile(archive).namelist()]
    wheels = [name for name in names if name.endswith(".whl")]
    assert len(wheels) > 10
    assert not [name for name in wheels if "/numpy-" in name or "/bpy-" in name]
    assert not [name for name in names if "__pycache__" in name or name.startswith(("tests/", "docs/", "."))]
