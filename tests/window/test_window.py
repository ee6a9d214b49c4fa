"""The extension in the window of a graphical Blender, where there is one.

``LIGHTSPHERE_WINDOW`` names a command that runs a Python script, with arguments, in such a window (its screen may be a
virtual one), and ``LIGHTSPHERE_ZIP`` the extension built for that Blender. The script's pictures and figures stay in
the folder that is printed.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
from pathlib import Path

import pytest

COMMAND, ARCHIVE = os.environ.get("LIGHTSPHERE_WINDOW", ""), os.environ.get("LIGHTSPHERE_ZIP", "")
STOPPED_WITHIN = 2.0  # seconds after Esc
STAGES = {"capture", "plan", "shape", "profile", "reflectance", "material", "relight", "keep", "compare", "inverse"}
PICTURES = (
    "rig",
    "presets",
    "running",
    "shape",
    "layer_normal",
    "profile",
    "material",
    "relight",
    "bases",
    "compare_split",
    "inverse",
)


@pytest.mark.slow
@pytest.mark.skipif(
    not (COMMAND and ARCHIVE), reason="no graphical Blender: LIGHTSPHERE_WINDOW and LIGHTSPHERE_ZIP unset"
)
def test_every_stage_by_its_button(tmp_path: Path) -> None:
    shutil.copy(Path(__file__).with_name("drive.py"), tmp_path)
    shutil.copy(ARCHIVE, tmp_path / "extension.zip")
    words = [*shlex.split(COMMAND), str(tmp_path / "drive.py"), str(tmp_path / "extension.zip"), str(tmp_path)]
    run = subprocess.run(words, capture_output=True, text=True, env={"GUI_TIMEOUT": "1200", **os.environ})
    print(tmp_path)
    assert run.returncode == 0 and "WINDOW DRIVEN" in run.stdout, run.stdout[-3000:] + run.stderr[-3000:]
    found = json.loads((tmp_path / "window.json").read_text())
    print(json.dumps(found, indent=1))
    assert found["seconds_to_stop"] < STOPPED_WITHIN
    assert set(found["stages"]) >= STAGES
    for name in PICTURES:
        assert (tmp_path / f"{name}.png").stat().st_size > 50_000, name
