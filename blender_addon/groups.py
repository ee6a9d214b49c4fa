"""Groups of surfaces that share a reflectance: edited before inverse rendering, applied or taken back after it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import bpy

from ..pipeline.blender.inverse import groups as surfaces
from ..pipeline.core.errors import LightsphereError
from ..pipeline.core.inverse import uncertainty

FIGURES = "inverse.json"
RECOVERED = "recovered.blend"


def listed(scene: bpy.types.Scene) -> None:
    """List the scene's groups anew, without results.

    Raises
    ------
    LightsphereError
        When the scene shows nothing whose reflectance could be found.
    """
    shown = scene.lightsphere
    found = surfaces.find(scene, shown.inverse.groups)
    shown.groups.clear()
    for group in found:
        item = shown.groups.add()
        item.name, item.told = group.name, f"keeps its material: it {group.kept}" if group.kept else ""
        for thing, number in group.slots:
            slot = item.slots.add()
            slot.object, slot.number, slot.original = thing, number, thing.material_slots[number].material


def assign(scene: bpy.types.Scene, objects: list[bpy.types.Object], name: str) -> None:
    """Make objects one group of a name, or, without a name, leave them to the rule; list the groups anew."""
    for item in objects:
        if name:
            item[surfaces.PROPERTY] = name
        elif surfaces.PROPERTY in item:
            del item[surfaces.PROPERTY]
    listed(scene)


def bring(scene: bpy.types.Scene, folder: Path) -> str:
    """Read what was found of every group and append its material; nothing is applied. Return what to tell."""
    listed(scene)
    figures = json.loads((folder / FIGURES).read_text(encoding="utf-8"))
    items = {item.name: item for item in scene.lightsphere.groups}
    found = {name: one for name, one in figures["groups"].items() if name in items}
    wanted = [one["material"] for one in found.values() if "material" in one]
    with bpy.data.libraries.load(str(folder / RECOVERED), link=False) as (_, target):
        target.materials = list(wanted)
    loaded = dict(zip(wanted, target.materials, strict=True))
    for name, one in found.items():
        items[name].told = told(one)
        if "material" in one:
            items[name].recovered = loaded[one["material"]]
            items[name].recovered.use_fake_user = True  # kept with the file until it is applied
    words = f"{len(items)} groups; the picture is rendered but for {100 * figures['rerendered_rel_rmse']:.2g} %"
    lamps = ", ".join(f"{lamp['name']} has {lamp['power']:.3g} {lamp['unit']}" for lamp in figures["lamps"])
    return f"{words}; {lamps}" if lamps else words


def told(found: dict[str, Any]) -> str:
    """Say what was found of a group: its level, its reflectances and how sure they are."""
    if found["level"] == "kept":
        return f"keeps its material: {found['why']}"
    words = [found["level"]]
    for kind, name in (("diffuse", "rho_d"), ("specular", "rho_s")):
        if name in found:
            words.append(f"{kind} " + " ".join(f"{value:.2f}" for value in found[name]))
    if "alpha_x" in found:
        words.append(f"slopes {found['alpha_x']:.3f} {found['alpha_y']:.3f}")
    if found.get("deviation"):
        words.append(f"± {100 * uncertainty(found):.1f} %")
    return ", ".join(words)


def apply(item: bpy.types.PropertyGroup) -> None:
    """Give a group its recovered material."""
    _dress(item, lambda slot: item.recovered)
    item.is_applied = True


def revert(item: bpy.types.PropertyGroup) -> None:
    """Give a group the materials back that it had."""
    _dress(item, lambda slot: slot.original)
    item.is_applied = False


def _dress(item: bpy.types.PropertyGroup, material_of: Any) -> None:
    for slot in item.slots:
        if slot.object is None or slot.number >= len(slot.object.material_slots):
            raise LightsphereError(f"the group {item.name!r} has lost a surface; list the groups anew")
        slot.object.material_slots[slot.number].material = material_of(slot)
