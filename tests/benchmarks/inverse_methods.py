"""How long three ways take to find the reflectances of the colour box: ours, the source's, and Mitsuba's with Adam.

Run as ``.venv-3.13/bin/python tests/benchmarks/inverse_methods.py [--mitsuba PYTHON]`` with the Python that
``bootstrap.py`` set up. Prints when the worst reflectance (rho_max_pct) came below 5, 2 and 1 % and stayed there, by
the clock of one machine in one run. Mitsuba 3 is no dependency: give the Python of an environment of its own, made
with ``pip install mitsuba numpy``, whose ``llvm_ad_rgb`` needs LLVM's library (19 works, 15 did not; it is named by
``DRJIT_LIBLLVM_PATH``). It is given the same geometry, camera, lamp and photograph, starts at the same grey, and
renders with its path-replay backpropagation (Vicini and others 2021).
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

ROOM, SECONDS = "colour-box", 60
LIMITS = (5.0, 2.0, 1.0)
SAMPLES, RATE, DEPTH = 16, 0.05, 64  # of Mitsuba: a pixel of both renders, Adam's step, bounces


def main() -> None:
    """Print the table, or be Mitsuba's part of it."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--mitsuba", help="Python of an environment with Mitsuba 3")
    parser.add_argument("--as-mitsuba", type=Path, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.as_mitsuba:
        mitsuba(given.as_mitsuba)
        return
    from inverse_bars import farthest  # needs Blender, which Mitsuba's environment lacks

    with tempfile.TemporaryDirectory() as folder:
        made = Path(folder)
        true = box(made)
        courses = {name: ours(made, method) for name, method in {"joint": "joint", "the source's": "source"}.items()}
        if given.mitsuba:
            subprocess.run([given.mitsuba, __file__, "--as-mitsuba", str(made)], check=True)
            courses["Mitsuba, Adam"] = json.loads((made / "mitsuba.json").read_text(encoding="utf-8"))
    print(f"{'seconds to':16}" + "".join(f"{limit:8g} %" for limit in LIMITS) + f"{'in the end':>14}")
    for name, course in courses.items():
        errors = [(at, max(farthest(found[group], true[group]) for group in true)) for at, found in course]
        times = [reached(errors, limit) for limit in LIMITS]
        print(f"{name:16}" + "".join(f"{t:>10}" for t in times) + f"{errors[-1][1]:12.2f} %")


def reached(errors: list[tuple[float, float]], limit: float) -> str:
    """Return after how many seconds the error was below a limit and stayed there."""
    above = [number for number, (_, error) in enumerate(errors) if error > limit]
    first = above[-1] + 1 if above else 0
    return f"{errors[first][0]:.1f}" if first < len(errors) else "never"


def box(made: Path) -> dict[str, list[float]]:
    """Render the photograph, write geometry, camera and lamp; return the true reflectances."""
    import bpy
    import normal_captures as captures

    from pipeline.blender import geometry
    from pipeline.blender import scene as scenes

    captures.command("scenes", "--photograph", ROOM, "-o", made / "photograph.exr")
    scene = scenes.load(ROOM)
    scene.view_layers[0].update()
    arrays, true = {}, {}
    for item, mesh, matrix in geometry.meshes(scene, backdrop=True):
        slots = [slot.material.name for slot in item.material_slots]
        for number, name in enumerate(slots):
            faces = [t.vertices[:] for t in mesh.loop_triangles if t.material_index == number]
            places = np.array([vertex.co[:] for vertex in mesh.vertices]) @ matrix[:3, :3].T + matrix[:3, 3]
            arrays[f"{name}/{item.name}"] = places[np.array(faces)]
            colour = bpy.data.materials[name].node_tree.nodes["Diffuse BSDF"].inputs["Color"].default_value
            true[name] = list(colour[:3])
    lamp = next(item for item in scene.objects if item.type == "LIGHT")
    camera = scene.camera
    np.savez(
        made / "box.npz",
        camera=np.array(camera.matrix_world),
        angle=np.degrees(camera.data.angle),
        lamp=np.array(lamp.matrix_world),
        sides=(lamp.data.size, lamp.data.size_y),
        watts=lamp.data.energy,
        size=(scene.render.resolution_x, scene.render.resolution_y),
        **arrays,
    )
    return true


def ours(made: Path, method: str) -> list[Any]:
    """Return the reflectances that a search of ours had, with the seconds since its start."""
    import normal_captures as captures

    out = made / method
    words = ("-o", out, "--json", made / f"{method}.json", "--budget", SECONDS)
    captures.command("inverse", ROOM, made / "photograph.exr", *words, "--method", method, "--levels", "diffuse")
    found = json.loads((made / f"{method}.json").read_text(encoding="utf-8"))
    return [(one["seconds"], one["diffuse"]) for one in found["history"]]


def mitsuba(made: Path) -> None:
    """Find the reflectances by Adam on the squared relative error, with Mitsuba's gradients."""
    import drjit as dr
    import mitsuba as mi

    mi.set_variant("llvm_ad_rgb")
    with np.load(made / "box.npz") as arrays:
        room = dict(arrays)
    photograph = np.array(
        mi.Bitmap(str(made / "photograph.exr")).convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.Float32)
    )
    names = sorted({key.split("/")[0] for key in room if "/" in key})
    scene = mi.load_dict(described(mi, made, room, names), optimize=False)  # else equal greys become one
    params = mi.traverse(scene)
    keys = {name: f"group{number}.reflectance.value" for number, name in enumerate(names)}
    optimizer = mi.ad.Adam(lr=RATE)
    for key in keys.values():
        optimizer[key] = mi.Color3f(params[key])
    params.update(optimizer)
    wanted = mi.TensorXf(photograph)
    # Cycles' camera does not see the lamp, Mitsuba's does: those pixels are left out
    dark = np.array(mi.render(scene, spp=SAMPLES)).max(axis=-1, keepdims=True) < photograph.max()
    weight = mi.TensorXf(dark / (photograph + photograph.mean() / 3) ** 2)
    course: list[Any] = []
    start, turn = time.perf_counter(), 0
    while time.perf_counter() - start < SECONDS:
        shown = mi.render(scene, params, spp=SAMPLES, seed=turn)
        dr.backward(dr.mean(weight * (shown - wanted) ** 2, axis=None))
        optimizer.step()
        for key in keys.values():
            optimizer[key] = dr.clip(optimizer[key], 1e-3, 0.98)
        params.update(optimizer)
        found = {name: [float(channel[0]) for channel in optimizer[key]] for name, key in keys.items()}
        course.append((time.perf_counter() - start, found))
        turn += 1
    (made / "mitsuba.json").write_text(json.dumps(course), encoding="utf-8")


def described(mi: Any, made: Path, room: dict[str, np.ndarray], names: list[str]) -> dict[str, Any]:
    """Return Blender's box as Mitsuba's scene, every group grey."""
    turned = np.diag([-1.0, 1.0, -1.0, 1.0])  # Mitsuba's camera looks along +z, x to the left
    width, height = (int(side) for side in room["size"])
    film = {"type": "hdrfilm", "width": width, "height": height, "rfilter": {"type": "gaussian", "stddev": 0.42}}
    radiance = float(room["watts"] / (np.pi * np.prod(room["sides"])))
    to_lamp = room["lamp"] @ np.diag([*room["sides"] / 2, 1.0, 1.0]) @ np.diag([1.0, -1.0, -1.0, 1.0])
    scene: dict[str, Any] = {
        "type": "scene",
        "integrator": {"type": "prb", "max_depth": DEPTH, "rr_depth": 8},
        "sensor": {
            "type": "perspective",
            "fov": float(room["angle"]),
            "to_world": mi.ScalarTransform4f(room["camera"] @ turned),
            "film": film,
            "sampler": {"type": "independent"},
        },
        "lamp": {
            "type": "rectangle",
            "to_world": mi.ScalarTransform4f(to_lamp),
            "emitter": {"type": "area", "radiance": {"type": "rgb", "value": [radiance] * 3}},
        },
    }
    for number in range(len(names)):
        scene[f"group{number}"] = {"type": "diffuse", "reflectance": {"type": "rgb", "value": [0.5, 0.5, 0.5]}}
    for key, corners in ((key, values) for key, values in room.items() if "/" in key):
        number = names.index(key.split("/")[0])
        mesh = mi.Mesh(key, 3 * len(corners), len(corners))
        params = mi.traverse(mesh)
        params["vertex_positions"] = corners.reshape(-1).astype(np.float32)
        params["faces"] = np.arange(3 * len(corners), dtype=np.uint32)
        params.update()
        file = made / f"{len(scene)}.ply"
        mesh.write_ply(str(file))
        bsdf = {"type": "ref", "id": f"group{number}"}
        scene[f"mesh{len(scene)}"] = {"type": "ply", "filename": str(file), "face_normals": True, "bsdf": bsdf}
    return scene


if __name__ == "__main__":
    main()
