"""The extension's preferences: where results go, what its caches weigh, what a bug report needs."""

from __future__ import annotations

import platform
import shutil
import time
from pathlib import Path

import bpy

PACKAGE = __package__.removesuffix(".blender_addon")
MEASURED_AGAIN = 5.0  # [s] after which a folder's size is measured again while it is shown

_sizes: dict[Path, tuple[float, int]] = {}


class LIGHTSPHERE_AP_preferences(bpy.types.AddonPreferences):
    """What holds for every file."""

    bl_idname = PACKAGE

    results: bpy.props.StringProperty(
        name="Results",
        description="Folder for captures and shapes of files that were never saved; "
        "those of a saved file go beside it. Empty: the extension's own folder",
        subtype="DIR_PATH",
    )

    def draw(self, context: bpy.types.Context) -> None:
        """Draw the preferences."""
        self.layout.prop(self, "results")
        for name, folder in (("Results", results_folder()), ("Compiled solvers", user_folder("kernels"))):
            row = self.layout.row()
            row.label(text=name)
            row.label(text=f"{size(folder) / 1e6:.0f} MB", translate=False)
            row.label(text=str(folder), translate=False)
        row = self.layout.row()
        row.operator("lightsphere.clear_kernels")
        row.operator("lightsphere.copy_report")


class LIGHTSPHERE_OT_clear_kernels(bpy.types.Operator):
    """Delete the compiled solvers; the next shape compiles them anew, which takes a minute or two"""

    bl_idname = "lightsphere.clear_kernels"
    bl_label = "Delete Compiled Solvers"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Delete them."""
        shutil.rmtree(user_folder("kernels"), ignore_errors=True)
        _sizes.clear()
        return {"FINISHED"}


class LIGHTSPHERE_OT_copy_report(bpy.types.Operator):
    """Copy what a bug report needs to the clipboard: versions, system, the last command and what it said"""

    bl_idname = "lightsphere.copy_report"
    bl_label = "Copy Report"

    def execute(self, context: bpy.types.Context) -> set[str]:
        """Copy it."""
        context.window_manager.clipboard = report()
        self.report({"INFO"}, "The report is in the clipboard")
        return {"FINISHED"}


def report() -> str:
    """Return versions, system, the last command and what it said."""
    from . import runs

    module = __import__(PACKAGE, fromlist=["bl_info"])
    version = getattr(module, "bl_info", {}).get("version", ())
    lines = [
        f"Lightsphere {'.'.join(map(str, version)) or 'from a checkout'}",
        f"Blender {bpy.app.version_string}, {bpy.app.build_platform.decode()}",
        f"{platform.platform()}, Python {platform.python_version()}",
    ]
    if runs.last is not None:
        lines += [f"last stage: {runs.last.stage.name} in {runs.last.folder}", *runs.last.task.log]
    return "\n".join(lines)


def results_folder() -> Path:
    """Return the folder for results of files that were never saved."""
    chosen = bpy.context.preferences.addons[PACKAGE].preferences.results
    return Path(bpy.path.abspath(chosen)) if chosen else user_folder("results")


def user_folder(name: str) -> Path:
    """Return a folder of this extension that Blender lets it write to, made if need be."""
    return Path(bpy.utils.extension_path_user(PACKAGE, path=name, create=True))


def size(folder: Path) -> int:
    """Return what a folder's files weigh [bytes], measured not more often than every few seconds."""
    when, known = _sizes.get(folder, (-MEASURED_AGAIN, 0))
    if time.monotonic() - when > MEASURED_AGAIN:
        known = sum(path.stat().st_size for path in folder.rglob("*") if path.is_file())
        _sizes[folder] = (time.monotonic(), known)
    return known


CLASSES = (LIGHTSPHERE_AP_preferences, LIGHTSPHERE_OT_clear_kernels, LIGHTSPHERE_OT_copy_report)
