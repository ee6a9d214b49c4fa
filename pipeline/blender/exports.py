"""Assets for other programs: glTF, USD with MaterialX, and plain PBR textures, all of the Principled version.

Blender's exporters run in a process of their own that opens the asset: on Blender 4.5 the glTF exporter and the threads
of the solvers in one process never end.
"""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ..core import images
from ..core.errors import LightsphereError
from ..core.material.principled import Principled
from . import exr, pixels, workers
from .principled import SUFFIX

COMMAND = "export-worker"
GLTF, USD = (".glb",), (".usda", ".usdc", ".usd", ".usdz")
CONVENTIONS = """PBR textures, metallic-roughness workflow, 16 bits.
base_color, specular_tint: sRGB. metallic, roughness, normal: linear.
normal: tangent space, +Y up (OpenGL). u to the right, v up; the first row is the top.
specular: IOR 1.5 at specular IOR level 1 (reflectance .08 at normal incidence), times specular_tint.
"""


def check_names(gltf: Path | None, usd: Path | None) -> None:
    """Raise LightsphereError for a file whose ending is not one of its kind."""
    for path, endings in ((gltf, GLTF), (usd, USD)):
        if path is not None and path.suffix not in endings:
            raise LightsphereError(f"{path}: the name must end in {' or '.join(endings)}")


def run(blend: Path, gltf: Path | None, usd: Path | None) -> None:
    """Export an asset.blend in a process of its own; raise LightsphereError with its last words where it fails."""
    words = [COMMAND, str(blend)]
    for option, path in (("--gltf", gltf), ("--usd", usd)):
        if path is not None:
            path.parent.mkdir(parents=True, exist_ok=True)
            words += [option, str(path)]
    command, environment = workers.command_line(*words)
    done = subprocess.run(command, env=environment, capture_output=True, text=True, errors="replace", check=False)
    missing = [str(path) for path in (gltf, usd) if path is not None and not path.is_file()]
    if done.returncode or missing:
        reason = " ".join(done.stderr.split())[-400:] or "Blender's exporter wrote nothing"
        raise LightsphereError(f"{blend} cannot be exported ({reason}); free space or choose another folder")


def export(blend: Path, gltf: Path | None, usd: Path | None) -> None:
    """Open an asset and export its recovered objects with their Principled materials."""
    bpy.ops.wm.open_mainfile(filepath=str(blend.resolve()), load_ui=False, use_scripts=False)
    shown = _dressed(bpy.context.view_layer)
    if not shown:
        raise LightsphereError(f"{blend} holds no Principled material; write it with --principled")
    if gltf is not None:
        bpy.ops.preferences.addon_enable(module="io_scene_gltf2")
        partial = _partial(gltf)
        bpy.ops.export_scene.gltf(filepath=str(partial.resolve()), export_format="GLB", use_selection=True)
        partial.replace(gltf)
    if usd is not None:
        # an archive's layer is named after its file, and Blender makes it elsewhere and moves it when it is whole
        partial = usd if usd.suffix == ".usdz" else _partial(usd)
        bpy.ops.wm.usd_export(
            filepath=str(partial.resolve()),
            selected_objects_only=True,
            export_animation=False,
            generate_materialx_network=True,
            export_textures_mode="NEW",
            relative_paths=True,
            overwrite_textures=True,
            convert_world_material=False,
        )
        partial.replace(usd)


def _partial(path: Path) -> Path:
    """Return the name under which a file is written until it is whole; exporters go by its ending."""
    return path.with_name(f".{path.stem}.part{path.suffix}")


def write_textures(folder: Path, found: Principled, normal_map: NDArray[np.float32] | None) -> None:
    """Write maps as PNG files of 16 bits, with their conventions."""
    folder.mkdir(parents=True, exist_ok=True)
    maps: dict[str, NDArray[Any]] = {
        "base_color": images.srgb(pixels.filled(found.base)),
        "specular_tint": images.srgb(pixels.filled(found.tint)),
        "metallic": pixels.filled(found.metallic),
        "roughness": pixels.filled(found.roughness),
    }
    if normal_map is not None:
        maps["normal"] = normal_map
    for name, values in maps.items():
        exr.write_png(folder / f"{name}.png", values)
    images.write_text(folder / "README.txt", CONVENTIONS)


def _dressed(layer: bpy.types.ViewLayer) -> list[bpy.types.Object]:
    """Give objects the Principled version of their materials, and select those that have one."""
    shown = []
    for item in layer.objects:
        versions = [_principled(slot.material) for slot in item.material_slots]
        item.select_set(any(versions))
        for slot, version in zip(item.material_slots, versions, strict=True):
            if version is not None:
                slot.material = version
        if any(versions):
            shown.append(item)
    return shown


def _principled(material: bpy.types.Material | None) -> bpy.types.Material | None:
    if material is None or material.name.endswith(SUFFIX):
        return material
    return bpy.data.materials.get(f"{material.name} {SUFFIX}")
