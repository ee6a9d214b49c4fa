"""A capture and its shape in one small file, relit like the folders that it was made of.

What a pixel shows under a light, y = L d^2 / I, is coded as what is expected of it where it is lit (:mod:`.lobes`: 29
weights a colour, a bit for every light) and a remainder (:mod:`.remainder`), which is coded the more exactly the larger
the file may be. Depth is kept as it is, normals to 1/8191. Not kept: truth, layers of the shape, the background of
the pictures, and which values were saturated; those are taken as expected.
"""

from __future__ import annotations

import io
import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .. import images
from ..arrays import read_npz
from ..camera import Camera
from ..capture import Capture
from ..errors import BROKEN_JSON, LightsphereError
from ..lights import Lights
from ..progress import Progress, Work
from ..shape import Shape
from . import lobes, remainder
from .occlusion import AWAY, LIT, SHADOWED
from .stack import FLOOR, Expected, arrange, expect, placed, surface, surrounded, unread, usable

FORMAT = "lightsphere-relightable"
VERSION = 2
FINEST = 8191  # of a normal's components
STEPS = (255, 63, 15)  # of the root of a weight; the coarser, the fewer bytes there are for a light
HALF_OF_ALL = 0.5  # of the bytes: what the weights leave for the remainder, where one of STEPS does
OCTAVE = 4  # steps of a pixel's mean value
LEVEL = np.float32(0.01)  # of the mean value of a pixel, below which an error of what is lit is not seen
DARKEST = np.float32(0.02)  # of the mean value of most pixels, where hardly any light is lit
DARK = np.float32(0.3)  # and what an error of what is shadowed is seen beside
HEADERS = 1000  # bytes by which arrays in a file exceed those alone
HALF = 6  # bytes of a pixel's three colours in half precision

BROKEN: tuple[type[Exception], ...] = (LightsphereError, *BROKEN_JSON)

Arrays = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class CompactCapture(Capture):
    """A capture whose pictures are decoded one at a time; ``folder`` is the file, ``files`` the numbers of its lights.

    Parameters
    ----------
    coded : Coded
    """

    coded: Coded = field(kw_only=True)

    def image(self, light: int) -> NDArray[np.float32]:
        """Return one picture (H, W, 3), black beside the object."""
        width, height = self.camera.resolution
        picture = np.zeros((height, width, 3), np.float32)
        picture[self.coded.mask] = self.coded.radiance(int(self.files[light]))
        return picture

    def mask(self) -> NDArray[np.bool_]:
        """Return which pixels show the object, (H, W)."""
        return self.coded.mask

    def prepared(self, shape: Shape, memory: float) -> Work[Expected]:
        """Return what :func:`.stack.expect` makes of a capture, nothing fitted anew."""
        stack, coded = unread(self, shape, memory), self.coded
        kinds = np.empty(stack.values.shape[:2], np.uint8)
        floor = np.float32(FLOOR) * coded.mean
        for light, number in enumerate(map(int, self.files)):
            model, lit = coded.expected(number)
            y = coded.value(number)
            stack.values[:, light] = np.where(lit, y / (model + floor), y)
            facing = np.where(model.any(axis=1), SHADOWED, AWAY)
            kinds[:, light] = np.where(lit[:, 0], LIT, facing)
            yield Progress("read", light + 1, len(self), "pictures")
        weights = np.concatenate([coded.weights, np.repeat(floor[:, None], 3, axis=2)], axis=1)
        return (yield from surrounded(stack, weights, kinds, self.camera))

    def truth(self) -> None:
        """Return None: no truth is kept."""

    def changed(self) -> list[str]:
        """Return nothing: a damaged file is not opened."""
        return []


@dataclass(frozen=True)
class Coded:
    """The pictures of a file and what decodes them.

    Parameters
    ----------
    mask : (H, W) bool
    points, normals, views : (P, 3) float64
        World space, of the mask's pixels.
    lights, intensity : (L, 3) float64
        Positions [m] and radiant intensities [W/sr]; see :func:`pipeline.core.relight.stack.placed`.
    weights : (P, C, 3) float32
        Of the lobes' columns.
    mean : (P, 1) float32
        Of y over the lit lights.
    lit : (L, ceil(P / 8)) uint8
        Packed bits.
    rest : pipeline.core.relight.remainder.Remainder
        Of y beside what is expected of a lit pixel, over :meth:`_scale`.
    """

    mask: NDArray[np.bool_]
    points: NDArray[np.float64]
    normals: NDArray[np.float64]
    views: NDArray[np.float64]
    lights: NDArray[np.float64]
    intensity: NDArray[np.float64]
    weights: NDArray[np.float32]
    mean: NDArray[np.float32]
    lit: NDArray[np.uint8]
    rest: remainder.Remainder

    def expected(self, light: int) -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
        """Return what is expected under a light where it is lit, (P, 3), and where it is, (P, 1)."""
        model = np.empty((len(self.points), 3), np.float32)
        lobes.expected(self.points, self.normals, self.views, self.lights[light], self.weights, model)
        return model, np.unpackbits(self.lit[light], count=len(model)).astype(bool)[:, None]

    def remaining(self, light: int, y: NDArray[np.floating]) -> NDArray[np.floating]:
        """Return what is left of y (P, 3) under a light, to be coded."""
        model, lit = self.expected(light)
        return np.asarray((y - np.where(lit, model, 0)) / self._scale(model, lit))

    def _scale(self, model: NDArray[np.float32], lit: NDArray[np.bool_]) -> NDArray[np.float32]:
        """Return what an error of y is seen beside: where light falls, y itself, which new lights are multiples of."""
        return np.where(lit, model + LEVEL * self.mean, DARK * self.mean)

    def value(self, light: int) -> NDArray[np.float32]:
        """Return y under a light, (P, 3)."""
        model, lit = self.expected(light)
        y = np.where(lit, model, 0) + self._scale(model, lit) * self.rest.of(light)
        return np.asarray(np.maximum(y, 0.0), np.float32)

    def radiance(self, light: int) -> NDArray[np.float32]:
        """Return the radiance under a light, (P, 3)."""
        d2 = ((self.points - self.lights[light]) ** 2).sum(axis=1)
        return np.asarray(self.value(light) / d2[:, None] * self.intensity[light], np.float32)


def write(path: Path, capture: Capture, shape: Shape, rate: float, memory: float) -> Work[dict[str, float]]:
    """Write a capture and its shape so that the object's pixels take 1/rate of their bytes in half precision.

    Parameters
    ----------
    path : Path
        The file, an ``.npz``.
    capture : Capture
        Of near or distant lights.
    shape : Shape
        Of that capture.
    rate : float
        Bytes of P pixels under L lights, 6 P L, over those of the file. A file that is still larger without a
        remainder has none.
    memory : float
        See :func:`pipeline.core.relight.stack.arrange`.

    Returns
    -------
    dict
        ``bytes``, the ``rate`` reached, and ``coded_rel_rmse``: root mean square of what the pictures of the file are
        off over that of the pictures, where they are usable.

    Raises
    ------
    LightsphereError
        When the shape is of another capture or a picture cannot be read; see :func:`.stack.arrange`.
    """
    mask = capture.mask()
    arrays = _stored(shape, mask) | {"head": _head(capture)}
    stored = _shape(capture.camera, mask, arrays)
    stack = yield from arrange(capture, stored, memory)
    weights, kinds = yield from expect(stack)
    whole = HALF * len(stack.points) * len(capture)
    for steps in STEPS:
        arrays |= _quantised(weights, kinds, steps)
        if len(_packed(arrays)) < HALF_OF_ALL * whole / rate:
            break
    coded = _coded(mask, stored, capture.lights, arrays, remainder.NONE)
    rest = stack.values  # its room is used for what is left
    for light in range(len(capture)):
        d2 = ((coded.points - coded.lights[light]) ** 2).sum(axis=1)
        y = usable(capture, light, mask) * (d2[:, None] / np.maximum(coded.intensity[light], 1e-30))
        rest[:, light] = np.nan_to_num(coded.remaining(light, y))
        yield Progress("compare", light + 1, len(capture), "pictures")
    coding = yield from remainder.coded(rest, whole / rate - len(_packed(arrays)) - HEADERS)
    data = _packed(arrays | coding)
    path.parent.mkdir(parents=True, exist_ok=True)
    images.write_bytes(path, data)
    missing = yield from _missing(capture, read(path)[0], mask)
    return {"bytes": len(data), "rate": whole / len(data), "coded_rel_rmse": missing}


def _missing(capture: Capture, decoded: Capture, mask: NDArray[np.bool_]) -> Work[float]:
    """Return the root mean square of what pictures differ by over that of the first, where it is usable."""
    lost, whole = 0.0, 0.0
    for light in range(len(capture)):
        seen = usable(capture, light, mask).astype(np.float64)
        good = np.isfinite(seen)
        lost += float(np.square((decoded.image(light)[mask] - seen)[good]).sum())
        whole += float(np.square(seen[good]).sum())
        yield Progress("check", light + 1, len(capture), "pictures")
    return float(np.sqrt(lost / max(whole, 1e-30)))


def read(path: Path) -> tuple[Capture, Shape]:
    """Read what :func:`write` wrote; raise LightsphereError for any other file."""
    try:
        arrays = read_npz(path)
        head = json.loads(arrays["head"].tobytes())
        if (head["format"], head["version"]) != (FORMAT, VERSION):
            raise LightsphereError("it is of another format; write it again")
        camera, lights = Camera.from_json(head["camera"]), Lights.from_json(head["light_kind"], head["lights"])
        width, height = camera.resolution
        mask = np.unpackbits(arrays["mask"], count=width * height).astype(bool).reshape(height, width)
        shape = _shape(camera, mask, arrays)
        coded = _coded(mask, shape, lights, arrays, remainder.decoded(arrays))
        numbers = tuple(str(light) for light in range(len(lights)))
        return CompactCapture(path, camera, lights, numbers, ("",) * len(lights), head["notes"], coded=coded), shape
    except BROKEN as error:
        raise LightsphereError(f"{path} is no relightable file that can be read: {error}") from error


def _packed(arrays: Arrays) -> bytes:
    """Return arrays as the bytes of an ``.npz``."""
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
    return file.getvalue()


def _head(capture: Capture) -> NDArray[np.uint8]:
    """Return what is no array, as the bytes of a JSON text."""
    value = {
        "format": FORMAT,
        "version": VERSION,
        "camera": capture.camera.as_json(),
        "light_kind": capture.lights.kind,
        "lights": capture.lights.as_json(),
        "notes": {"source": capture.notes.get("scene", capture.folder.name)},
    }
    return np.frombuffer(json.dumps(value).encode(), np.uint8)


def _coded(mask: NDArray[np.bool_], shape: Shape, lights: Lights, arrays: Arrays, rest: remainder.Remainder) -> Coded:
    """Return what decodes the arrays of a file; raise ValueError when their sizes are not those of one file."""
    count, number = int(mask.sum()), len(lights)
    wanted = {
        "weights": (lobes.COLUMNS, 3, count),
        "top": (lobes.COLUMNS,),
        "octave": (count,),
        "lit": (number, (count + 7) // 8),
    }
    sizes = {name: arrays[name].shape for name in wanted}
    terms = len(rest.coefficients)
    fits = not terms or (rest.basis.shape, rest.coefficients.shape) == ((number, terms), (terms, 3, count))
    if sizes != wanted or not fits:
        raise ValueError(f"its arrays do not belong together: {sizes}")
    geometry = surface(shape, mask)
    mean = np.exp2(arrays["octave"].astype(np.float32) / np.float32(OCTAVE))[:, None]
    return Coded(mask, *geometry, *placed(lights, geometry[0]), _weights(arrays), mean, arrays["lit"], rest)


def _stored(shape: Shape, mask: NDArray[np.bool_]) -> Arrays:
    """Return what is kept of a mask and the shape of its pixels."""
    known = shape.within(mask)
    return {
        "mask": np.packbits(mask),
        "depth": changes(known.depth[mask].view(np.int32)),
        "confidence": changes(np.round(255 * known.confidence[mask])),
        "normal": changes(np.round(FINEST * np.nan_to_num(known.normal[mask])).T),
    }


def _shape(camera: Camera, mask: NDArray[np.bool_], arrays: Arrays) -> Shape:
    """Return the shape that is stored, of normals that are not quite those of the one that was given."""
    depth, confidence = np.full((2, *mask.shape), np.nan, np.float32)
    normal = np.full((*mask.shape, 3), np.nan, np.float32)
    depth[mask] = sums(arrays["depth"]).view(np.float32)
    confidence[:] = 0.0
    confidence[mask] = sums(arrays["confidence"]) / np.float32(255)
    steps = sums(arrays["normal"]).T.astype(np.float32)
    length = np.linalg.norm(steps, axis=-1, keepdims=True)
    normal[mask] = np.where(length > 0, steps / np.maximum(length, 1), np.nan)
    return Shape(camera, depth, normal, confidence)


def _quantised(expected: NDArray[np.float32], kinds: NDArray[np.uint8], finest: int) -> Arrays:
    """Return what is kept of an expectation: weights, mean level of y and which lights are lit.

    The roots of the weights are in steps, (C, 3, P), red and blue as their difference to green.
    """
    weights = expected[:, : lobes.COLUMNS]
    top = np.maximum(weights.max(axis=(0, 2)), np.float32(1e-30))
    steps = np.round(finest * np.sqrt(weights / top[:, None])).astype(np.uint8)
    steps[..., 0::2] -= steps[..., 1:2]  # modulo 256
    mean = expected[:, lobes.COLUMNS].max(axis=-1) / FLOOR
    octave = OCTAVE * np.log2(np.maximum(mean, DARKEST * np.median(mean)))
    return {
        "weights": np.ascontiguousarray(steps.transpose(1, 2, 0)),
        "top": top / np.float32(finest**2),
        "octave": np.clip(np.round(octave), -128, 127).astype(np.int8),
        "lit": np.packbits((kinds == LIT).T, axis=1),
    }


def _weights(arrays: Arrays) -> NDArray[np.float32]:
    """Return the weights (P, C, 3) of :func:`_quantised`."""
    steps = arrays["weights"].transpose(2, 0, 1).copy()
    steps[..., 0::2] += steps[..., 1:2]
    return np.asarray(np.square(steps, dtype=np.float32) * arrays["top"][:, None], np.float32)


def changes(numbers: NDArray[Any]) -> NDArray[np.uint8]:
    """Return whole numbers (..., P) as the bytes of their change from pixel to pixel (4, ..., P), the lowest first.

    A change c is kept as 2 c or, below 0, as -2 c - 1: the upper bytes of small ones are 0 and take no room.
    """
    change = np.diff(numbers.astype("<i4"), axis=-1, prepend=np.int32(0))  # modulo 2^32
    folded = np.ascontiguousarray((change << 1) ^ (change >> 31))
    return np.ascontiguousarray(np.moveaxis(folded[..., None].view(np.uint8), -1, 0))


def sums(changes: NDArray[np.uint8]) -> NDArray[np.int32]:
    """Return the numbers of :func:`changes`."""
    folded = np.ascontiguousarray(np.moveaxis(changes, 0, -1)).view("<u4")[..., 0]
    change = (folded >> 1).astype(np.int32) ^ -(folded & 1).astype(np.int32)
    return np.asarray(np.cumsum(change, axis=-1, dtype=np.int32))
