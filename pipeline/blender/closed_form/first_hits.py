"""The first hits of a camera's pixels with their closures, read off a few pictures by Cycles.

For every closure of a material a copy of that material shows it alone, under a few suns, and writes its inputs,
whatever nodes and textures they come from, into passes. Cycles' own passes tell the rest: the normal that it bends at
silhouettes, the diffuse colour that a Principled BSDF's reflection leaves, the scale that multiple scattering brings.
"""

from __future__ import annotations

import contextlib
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from numpy.typing import NDArray

from ...core import direct_light as direct
from ...core.camera import Camera
from ...core.lights import Lights
from .. import cycles, exr, lamps
from ..geometry import RENDERED
from .closures import Closure, Inexact, closures
from .shadows import Triangles

PASSES = (
    *("use_pass_combined", "use_pass_position", "use_pass_normal", "use_pass_material_index"),
    *("use_pass_diffuse_color", "use_pass_glossy_color", "use_pass_glossy_direct"),
)
#: Names of our passes, and whether they are colours.
OURS = {"colour": True, "share": False, "roughness": False, "ior": False, "level": False, "shading": True, "true": True}
PREFIX = "lightsphere_"


def surface(
    scene: bpy.types.Scene, camera: Camera, triangles: Triangles, seed: int
) -> tuple[NDArray[np.bool_], direct.Surface]:
    """Return which pixels (H, W) of a camera show a surface, and what they show.

    Raises
    ------
    Inexact
        When a material has no closed form.
    """
    materials = _materials(scene)
    made_of = [closures(material) for material in materials]
    layers = []
    for number in range(max([1, *map(len, made_of)])):
        shown = [parts[number] if number < len(parts) else None for parts in made_of]
        layers.append((shown, _passes(scene, camera, dict(zip(materials, shown, strict=True)), seed)))
    first = layers[0][1]
    index = first["material"][..., 0].astype(np.int64)
    hit = index > 0
    _, directions = camera.rays()
    to_camera = -np.broadcast_to(directions, (*hit.shape, 3))[hit]
    position, true = first["position"][hit].astype(np.float64), _unit(first["true"][hit])
    lobes = [_lobes([None, *shown], index[hit], passes, hit, to_camera, camera) for shown, passes in layers]
    stacked = direct.Lobes(*(np.stack([getattr(one, name) for one in lobes]) for name in direct.Lobes.__annotations__))
    lift, cutoff = triangles.lifts(camera, position, to_camera, true)
    return hit, direct.Surface(position, to_camera, _unit(first["shading"][hit]), true, lift, cutoff, stacked)


def _materials(scene: bpy.types.Scene) -> list[bpy.types.Material]:
    """Return the materials of what a scene renders; raise Inexact for an object that lacks one."""
    found: dict[bpy.types.Material, None] = {}
    for item in scene.objects:
        if item.hide_render or (item.type == "EMPTY" and item.instance_type == "NONE"):
            continue
        if item.type in RENDERED:
            if not item.material_slots or any(slot.material is None for slot in item.material_slots):
                raise Inexact(f"the object {item.name} without a material")
            found |= dict.fromkeys(slot.material for slot in item.material_slots)
        elif item.type not in ("LIGHT", "CAMERA", "ARMATURE", "LATTICE", "SPEAKER"):
            raise Inexact(f"the object {item.name}, which is not a surface")
    return list(found)


def _passes(
    scene: bpy.types.Scene, camera: Camera, shown: dict[bpy.types.Material, Closure | None], seed: int
) -> dict[str, NDArray[np.float32]]:
    """Return the passes of a picture in which each material shows one closure alone.

    ``"glossy"`` (S, H, W, 3) is what it reflects of each of the suns that are needed.
    """
    layer = scene.view_layers[0]
    lights = _suns(camera)
    scaled = any(one is not None and one.measured and one.distribution != direct.LAMBERT for one in shown.values())
    with (
        tempfile.TemporaryDirectory() as folder,
        cycles.measuring(scene, camera, cycles.DIRECT, seed),
        cycles.openexr(scene, layers=True),
        cycles.own_lights_hidden(scene),
        cycles.changed(layer, dict.fromkeys(PASSES, True)),
        _our_passes(layer),
        _alone(scene, shown),
        lamps.lamp(scene, lights.kind) as lamp,
    ):
        lamp.data.use_shadow = False
        path = Path(folder) / "passes.exr"
        pictures = []
        for index in range(len(lights) if scaled else 1):
            lamps.shine(lamp, lights, index)
            cycles.render(scene, path)
            pictures.append(_named(exr.read(path)))
    glossy = np.stack([one["glossy light"] * one["glossy colour"] for one in pictures])
    return pictures[0] | {"glossy": glossy}


def _named(channels: dict[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float32]]:
    """Return passes (H, W, n) by our names from the channels of a file by either Blender."""
    names = {"Position": "position", "Normal": "normal", "DiffCol": "diffuse", "Diffuse Color": "diffuse"}
    names |= {"GlossCol": "glossy colour", "Glossy Color": "glossy colour"}
    names |= {"GlossDir": "glossy light", "Glossy Direct": "glossy light"}
    names |= {"IndexMA": "material", "Material Index": "material"}
    names |= {PREFIX + name: name for name in OURS}
    found: dict[str, dict[str, NDArray[np.float32]]] = {}
    for key, plane in channels.items():
        *_, name, letter = key.split(".")
        if name in names:
            found.setdefault(names[name], {})[letter] = plane
    return {name: np.stack(list(_in_order(planes)), axis=-1) for name, planes in found.items()}


def _in_order(planes: dict[str, NDArray[np.float32]]) -> Iterator[NDArray[np.float32]]:
    for letter in "RXGYBZV":
        if letter in planes:
            yield planes[letter]


def _suns(camera: Camera) -> Lights:
    """Return suns of irradiance 1 from behind the camera and from three sides: one of them a point's front faces."""
    x, y, z = camera.to_world[:3, :3].T
    turns = np.radians([90, 210, 330])
    sides = [0.5 * z + 0.75**0.5 * (np.cos(turn) * x + np.sin(turn) * y) for turn in turns]
    return Lights("distant", np.stack([z, *sides]), np.ones((4, 3)), np.full(4, 2))


@contextlib.contextmanager
def _our_passes(layer: bpy.types.ViewLayer) -> Iterator[None]:
    made = []
    try:
        for name, colour in OURS.items():
            one = layer.aovs.add()
            one.name, one.type = PREFIX + name, "COLOR" if colour else "VALUE"
            made.append(one.name)
        yield
    finally:
        for name in made:
            layer.aovs.remove(next(one for one in layer.aovs if one.name == name))


@contextlib.contextmanager
def _alone(scene: bpy.types.Scene, shown: dict[bpy.types.Material, Closure | None]) -> Iterator[None]:
    """Let copies of the materials show one closure each for a while."""
    copies = {}
    with contextlib.ExitStack() as stack:
        for number, (material, closure) in enumerate(shown.items(), start=1):
            copies[material] = material.copy()
            stack.callback(bpy.data.materials.remove, copies[material])
            copies[material].pass_index = number
            _show(copies[material], closure)
        for item in scene.objects:
            for slot in item.material_slots:
                if slot.material in copies:
                    stack.enter_context(cycles.changed(slot, {"material": copies[slot.material]}))
        yield


def _show(material: bpy.types.Material, closure: Closure | None) -> None:
    """Connect a closure to the output, and its inputs to our passes."""
    tree = material.node_tree
    geometry = tree.nodes.new("ShaderNodeNewGeometry")
    _write(tree, "true", geometry.outputs["True Normal"])
    _write(tree, "shading", geometry.outputs["Normal"])
    output = tree.get_output_node("CYCLES").inputs["Surface"]
    if closure is None:
        for link in output.links:
            tree.links.remove(link)
        _write(tree, "share", 0.0)
        return
    node = tree.nodes[closure.node]
    _write(tree, "share", _share(tree, closure))
    if closure.colour:
        _write(tree, "colour", node.inputs[closure.colour])
    for name, socket in {"roughness": "Roughness", "ior": "IOR", "level": "Specular IOR Level"}.items():
        if socket in node.inputs:
            _write(tree, name, node.inputs[socket])
    tree.links.new(node.outputs[0], output)
    if closure.fresnel == direct.DIELECTRIC:  # its diffuse part out of the way
        for link in node.inputs["Base Color"].links:
            tree.links.remove(link)
        node.inputs["Base Color"].default_value = (0, 0, 0, 1)


def _write(tree: bpy.types.NodeTree, name: str, value: Any) -> None:
    """Send what a socket gives or takes, or a number, to one of our passes."""
    node = tree.nodes.new("ShaderNodeOutputAOV")
    node.aov_name = PREFIX + name
    _feed(tree, value, node.inputs["Color" if OURS[name] else "Value"])


def _share(tree: bpy.types.NodeTree, closure: Closure) -> Any:
    """Return a socket with the product of the mixing factors on a closure's path, or 1."""
    total: Any = 1.0
    for name, second in closure.path:
        factor = tree.nodes[name].inputs[0]
        part = _calculate(tree, "ADD" if second else "SUBTRACT", 0.0 if second else 1.0, factor)
        total = part if total == 1.0 else _calculate(tree, "MULTIPLY", total, part)
    return total


def _calculate(tree: bpy.types.NodeTree, operation: str, *values: Any) -> bpy.types.NodeSocket:
    """Return the socket of a sum, difference or product, cut to 0 to 1."""
    node = tree.nodes.new("ShaderNodeMath")
    node.operation, node.use_clamp = operation, True
    for target, value in zip(node.inputs, values, strict=False):
        _feed(tree, value, target)
    return node.outputs[0]


def _feed(tree: bpy.types.NodeTree, value: Any, target: bpy.types.NodeSocket) -> None:
    """Give a socket what another gives or takes, or a number."""
    if isinstance(value, float):
        target.default_value = value
    elif value.is_output:
        tree.links.new(value, target)
    elif value.is_linked:
        tree.links.new(value.links[0].from_socket, target)
    else:
        target.default_value = value.default_value


def _lobes(
    shown: list[Closure | None],
    index: NDArray[np.int64],
    passes: dict[str, NDArray[np.float32]],
    hit: NDArray[np.bool_],
    to_camera: NDArray[np.float64],
    camera: Camera,
) -> direct.Lobes:
    """Return one closure of every pixel (1 lobe); ``shown`` holds it by the material's number."""

    def of_pixel(name: str) -> NDArray[np.float64]:
        return passes[name][hit].astype(np.float64)

    def chosen(value: Any, missing: int) -> NDArray[Any]:
        return np.array([missing if one is None else value(one) for one in shown])[index]

    distribution = chosen(lambda c: c.distribution, direct.LAMBERT).astype(np.int8)
    fresnel = chosen(lambda c: c.fresnel, direct.NO_FRESNEL).astype(np.int8)
    measured = chosen(lambda c: c.measured, 0).astype(bool)
    diffuse = distribution == direct.LAMBERT
    colour = np.maximum(of_pixel("colour"), 0.0)
    normal = np.where(diffuse[:, None], of_pixel("shading"), of_pixel("normal"))
    ior = _ior(of_pixel("ior")[:, 0], of_pixel("level")[:, 0])
    f0 = np.where(
        (fresnel == direct.DIELECTRIC)[:, None], (((ior - 1) / (ior + 1)) ** 2)[:, None], np.minimum(colour, 1.0)
    )
    alpha = np.clip(of_pixel("roughness")[:, 0], 0, 1) ** 2
    unscaled = direct.Lobes(
        distribution[None], fresnel[None], np.ones((1, len(index), 3)), _unit(normal)[None], alpha[None],
        f0[None], ior[None],
    )  # fmt: skip
    seen = passes["glossy"][:, hit].astype(np.float64)
    suns = _suns(camera).position[: len(seen)]
    white = np.stack([direct.white(unscaled, np.broadcast_to(sun, to_camera.shape), to_camera)[0] for sun in suns])
    white[seen == 0] = 0  # Cycles sees nothing of a light behind the shading normal
    power = (white**2).sum(axis=0)
    scale = np.divide((white * seen).sum(axis=0), power, out=np.zeros_like(power), where=power > 0)
    scale = np.where(diffuse[:, None], of_pixel("diffuse"), scale)
    weight = np.where(measured[:, None], scale, colour) * np.maximum(of_pixel("share"), 0)
    weight[chosen(lambda c: 1, 0) == 0] = 0
    return direct.Lobes(distribution, fresnel, weight, unscaled.normal[0], alpha, f0, ior)


def _ior(ior: NDArray[np.float64], level: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the index of refraction of which a Principled BSDF's specular level makes another."""
    ior = np.maximum(ior, 1e-5)
    f0 = np.clip(((ior - 1) / (ior + 1)) ** 2 * 2 * np.maximum(level, 0), 0, 0.99)
    changed = (1 + np.sqrt(f0)) / (1 - np.sqrt(f0))
    changed = np.where(ior < 1, 1 / changed, changed)
    return np.where(level == 0.5, ior, changed)


def _unit(vector: NDArray[Any]) -> NDArray[np.float64]:
    vector = vector.astype(np.float64)
    return np.asarray(vector / np.maximum(np.linalg.norm(vector, axis=-1, keepdims=True), 1e-30))
