"""Run inside a bare environment with the zip's path: install it as an artist does, use it, take it out."""

import importlib.util
import sys
from pathlib import Path
from typing import Any

import bpy

# isort: split
import addon_utils  # Blender's own, there once bpy is imported

MODULE = "bl_ext.user_default.lightsphere"
BUNDLED = ("numba", "scipy", "OpenEXR", "typer")


def main(archive: str, work: Path) -> None:
    assert not [name for name in BUNDLED if importlib.util.find_spec(name)], "the environment already has the wheels"
    before = traces()
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    assert addon_utils.check(MODULE) == (True, True)  # the operator says FINISHED even when it failed
    extensions = Path(bpy.utils.user_resource("EXTENSIONS"))
    for name in BUNDLED:
        found = importlib.util.find_spec(name)
        assert found and found.origin and Path(found.origin).is_relative_to(extensions / ".local"), name
    use(work)
    preferences().results = str(work / "elsewhere")
    # An upgrade:
    bpy.ops.extensions.package_install_files(filepath=archive, repo="user_default", enable_on_install=True)
    assert addon_utils.check(MODULE) == (True, True)
    assert preferences().results == str(work / "elsewhere")
    opened = bpy.ops.lightsphere.open_capture(filepath=str(work / "work.lightsphere" / "capture_001" / "capture.json"))
    assert opened == {"FINISHED"}
    assert not list((extensions / "user_default" / "lightsphere").rglob("*.nb[ic]")), "kernels beside the code"
    addon_utils.disable(MODULE, default_set=True)
    assert traces() == before
    repositories = [item.module for item in bpy.context.preferences.extensions.repos]
    bpy.ops.extensions.package_uninstall(repo_index=repositories.index("user_default"), pkg_id="lightsphere")
    assert not (extensions / "user_default" / "lightsphere").exists()
    left = [name for name in BUNDLED if list((extensions / ".local").rglob(f"site-packages/{name}"))]
    assert not left, left
    print("USED AND REMOVED", bpy.app.version_string)


def use(work: Path) -> None:
    """Capture a sphere and recover its shape and material by the operators."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=1.0)
    bpy.ops.object.camera_add(location=(0, -5, 0), rotation=(1.5707963, 0, 0))
    scene.camera = bpy.context.object
    for name, value in {"inner": 40, "outer": 20, "resolution": 24, "effects": "direct"}.items():
        setattr(scene.lightsphere.capture, name, value)
    bpy.ops.wm.save_as_mainfile(filepath=str(work / "work.blend"))
    for operator in ("add_rig", "capture", "shape", "material"):
        assert getattr(bpy.ops.lightsphere, operator)() == {"FINISHED"}, operator
    assert len(scene.objects["shape_001"].data.polygons) > 50
    assert scene.objects["Recovered"].active_material is not None


def preferences() -> Any:
    """Return the extension's preferences."""
    return bpy.context.preferences.addons[MODULE].preferences


def traces() -> set[str]:
    """Return what of the add-on Blender knows."""
    types = {name for name in dir(bpy.types) if "lightsphere" in name.lower()}
    return types | {f"Scene.{name}" for name in dir(bpy.types.Scene) if "lightsphere" in name}


if __name__ == "__main__":
    main(sys.argv[1], Path(sys.argv[2]))
