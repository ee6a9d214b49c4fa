"""Compile every kernel once, on a small drawn ball, so that the first real solve does not wait for it.

Set-up runs ``python -m pipeline.core.warm``; what is compiled stays in numba's cache on disk.
"""

from __future__ import annotations

import dataclasses
import tempfile
from pathlib import Path

import numpy as np

from . import direct_light as direct
from . import images
from .camera import Camera
from .capture import Capture
from .lights import Lights
from .progress import finish
from .reflectance import ReflectanceSettings
from .reflectance.fit import fit
from .relight import INTERPOLATIONS, RelightSettings, compact
from .relight.emitters import point
from .relight.render import prepare, relit
from .rig import sphere
from .shape.double_sphere import recover
from .shape.photometric import recover as photometric
from .shape.settings import OBJECTIVES, ShapeSettings
from .shape.uncalibrated import recover as uncalibrated

SIZE = 12
LIGHTS = (60, 30)
PHOTOGRAPHS = 12  # under lights that are not known
COARSE = 0.1  # step of pictures that hides what is lit


def main() -> None:
    """Solve shape and reflectance of the ball by every objective and method, relight it by every interpolation."""
    with tempfile.TemporaryDirectory() as folder:
        capture = drawn(Path(folder))
        for objective in OBJECTIVES:
            shape = finish(recover(capture, dataclasses.replace(ShapeSettings(), objective=objective)))
        finish(recover(drawn(Path(folder) / "rounded", COARSE), ShapeSettings()))
        finish(photometric.recover(capture, dataclasses.replace(ShapeSettings(), method="acls")))
        distant = dataclasses.replace(
            capture, lights=dataclasses.replace(capture.lights, kind="distant", position=sphere(len(capture)))
        )
        finish(
            photometric.recover(
                distant, dataclasses.replace(ShapeSettings(), method="acls", start="symmetry", held_out=10)
            )
        )
        facing = capture.select(np.argsort(capture.lights.position[: LIGHTS[0], 2])[-PHOTOGRAPHS:])
        nowhere = dataclasses.replace(facing.lights, kind="unknown", position=0 * facing.lights.position)
        photographs = dataclasses.replace(facing, lights=nowhere)
        for objective in OBJECTIVES:
            unknown = dataclasses.replace(ShapeSettings(), method="uncalibrated", objective=objective)
            finish(uncalibrated.recover(photographs, unknown))
        finish(fit(shape, capture, ReflectanceSettings()))
        light_a_point()
        for interpolation in INTERPOLATIONS:
            prepared = finish(prepare(capture, shape, RelightSettings(interpolation=interpolation)))
            finish(relit(prepared, [point([1.0, 2.0, 1.5], [1.0] * 3)]))
        finish(compact.write(Path(folder) / "compact.npz", capture, shape, rate=5, memory=RelightSettings().memory))


def light_a_point() -> None:
    """Light one point, from above."""
    one, up = np.ones((1, 1)), np.array([[0.0, 0.0, 1.0]])
    lobe = direct.Lobes(
        np.array([[direct.GGX]], np.int8), np.zeros((1, 1), np.int8), one[..., None].repeat(3, -1), up[None], one,
        one[..., None].repeat(3, -1), one,
    )  # fmt: skip
    surface = direct.Surface(0 * up, up, up, up, 0 * up, one[0], lobe)
    lights = Lights("near", up, up, np.zeros(1, np.int64))
    direct.radiance(surface, lights, 0, 0.0, lambda rays: np.zeros(len(rays.start), bool))
    direct.white(lobe, up, up)


def drawn(folder: Path, step: float = 0.0) -> Capture:
    """Draw a ball of radius 0.8 m, left half Lambertian and right half of two lobes, which one lobe does not fit.

    Values are rounded to a step unless that is 0.
    """
    folder.mkdir(exist_ok=True)
    to_world = np.eye(4)
    to_world[2, 3] = 5.0
    camera = Camera("pinhole", to_world, (SIZE, SIZE), (2.5 * SIZE, 2.5 * SIZE), (SIZE / 2, SIZE / 2))
    origins, directions = camera.rays()
    along = -(origins * directions).sum(-1)
    inside = along**2 - (origins**2).sum(-1) + 0.64
    points = origins + (along - np.sqrt(np.maximum(inside, 0.0)))[..., None] * directions
    mask = inside > 0
    normal = points / np.linalg.norm(points, axis=-1, keepdims=True)
    position = np.concatenate([radius * sphere(count) for radius, count in zip((2.0, 3.0), LIGHTS, strict=True)])
    lights = Lights("near", position, np.full((len(position), 3), 12.0), np.repeat([0, 1], LIGHTS))
    files = tuple(f"light_{i:04d}.exr" for i in range(len(lights)))
    for name, light in zip(files, position, strict=True):
        reach = light - points
        d2 = (reach**2).sum(-1, keepdims=True)
        to_light = reach / np.sqrt(d2)
        cosine = np.maximum((normal * to_light).sum(-1), 0.0)
        half = to_light - directions
        half /= np.linalg.norm(half, axis=-1, keepdims=True)
        gloss = np.maximum((normal * half).sum(-1), 0.0)
        lobes = (0.6 * gloss**200 + 0.3 * gloss**12) * (cosine > 0) * (np.arange(SIZE) > SIZE // 2)
        picture = ((0.1 * cosine + lobes) * mask)[..., None] * 12.0 / d2
        if step:
            picture = step * np.round(picture / step)
        images.write_rgb(folder / name, np.repeat(picture, 3, axis=-1).astype(np.float32))
    images.write_channels(folder / "mask.exr", {"mask.V": mask.astype(np.float32)})
    return Capture(folder, camera, lights, files, ("",) * len(files), {"diameter": 1.6})


if __name__ == "__main__":
    main()
