"""Samples in the layouts of others, beside our captures.

``diligent/NAMEPNG``
    As Shi and others (CVPR 2016) publish theirs: linear PNG of 16 bits, ``filenames.txt``, ``light_directions.txt``
    and ``light_intensities.txt`` (x right, y up, z to the viewer), ``mask.png``, ``Normal_gt.mat``.
``near/NAME``
    As the rigs of Quéau and others (2018) and LUCES are described: the same pictures, ``light.mat`` (S in mm about the
    camera, x right, y down, z forward; Phi) and ``camera.mat`` (K, the first pixel's centre at (1, 1)).
``hdf5/NAME.hdf5``
    Keys as BlenderProc's: ``colors`` (L, H, W, 3) of 8 bits in sRGB, ``depth`` (H, W), along the camera's axis [m],
    ``normals`` (H, W, 3) from -1..1 to 0..1, ``category_id_segmaps`` (H, W), the number of the material; and ours:
    ``radiance`` (L, H, W, 3), ``light_positions`` and ``light_intensities`` (L, 3), ``mask``, ``capture`` (JSON).
"""

from __future__ import annotations

import io
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.io import savemat

from ...core import images
from ...core.capture import FILE, Capture, Truth
from ...core.dataset.draw import Sample
from ...core.dataset.recipe import CAPTURE
from ...core.errors import LightsphereError
from .. import exr

MATLAB_TEXT = 116  # bytes of a MATLAB file that hold words, among them the date
MM = 1000.0
TO_THEIRS = np.array([1.0, -1.0, -1.0])  # y up, z to the viewer, to y down, z forward
FAR_AWAY = 1e10  # depth where nothing is [m], as BlenderProc has it


def write(wanted: tuple[str, ...], capture: Capture, made: Path, sample: Sample) -> None:
    """Write a capture in other layouts beside it; one that only served them is left out.

    Raises
    ------
    LightsphereError
        When a library is missing, or the disk is full.
    """
    writers: dict[str, Callable[[Capture, Path], None]] = {
        "diligent": lambda capture, folder: _diligent(capture, folder / f"{sample.name}PNG"),
        "near": lambda capture, folder: _near(capture, folder / sample.name),
        "hdf5": lambda capture, folder: _hdf5(capture, folder / f"{sample.name}.hdf5"),
    }
    for name, writer in writers.items():
        if name in wanted:
            (made / name).mkdir()
            writer(capture, made / name)
    if CAPTURE not in wanted:
        shutil.rmtree(made / CAPTURE)


def library_for(wanted: tuple[str, ...]) -> None:
    """Raise LightsphereError when a layout needs a library that is not here."""
    if "hdf5" in wanted:
        _h5py()


def _diligent(capture: Capture, folder: Path) -> None:
    folder.mkdir()
    scale = _pngs(capture, folder)
    direction = capture.camera.normals_to_camera(capture.lights.position)
    names = _names(len(capture))
    images.write_text(folder / "filenames.txt", "".join(f"{name}\n" for name in names))
    images.write_text(folder / "light_directions.txt", _rows(direction))
    images.write_text(folder / "light_intensities.txt", _rows(capture.lights.intensity * scale))


def _near(capture: Capture, folder: Path) -> None:
    folder.mkdir()
    scale = _pngs(capture, folder)
    camera = capture.camera
    seen = (capture.lights.position - camera.to_world[:3, 3]) @ camera.to_world[:3, :3]
    count = len(capture)
    lights = {"S": MM * seen * TO_THEIRS, "Phi": capture.lights.intensity * scale}
    lights |= {"Dir": np.tile(TO_THEIRS * (0.0, 0.0, -1.0), (count, 1)), "mu": np.zeros((count, 1))}
    _matlab(folder / "light.mat", lights)
    k = np.array(
        [[camera.focal[0], 0, camera.centre[0] + 0.5], [0, camera.focal[1], camera.centre[1] + 0.5], [0, 0, 1]]
    )
    _matlab(folder / "camera.mat", {"K": k})


def _hdf5(capture: Capture, path: Path) -> None:
    truth = _truth(capture)
    radiance = np.stack([capture.image(light) for light in range(len(capture))])
    along = capture.camera.rays()[1] @ -capture.camera.to_world[:3, 2]  # cosine to the camera's axis
    known = np.isfinite(truth.depth)
    arrays: dict[str, NDArray[Any]] = {
        "colors": np.round(255 * images.srgb(np.clip(radiance * _scale(capture), 0, 1))).astype(np.uint8),
        "depth": np.where(known, truth.depth * along, FAR_AWAY).astype(np.float32),
        "normals": np.where(known[..., None], (truth.normal + 1) / 2, 0).astype(np.float32),
        "category_id_segmaps": truth.material,
        "radiance": radiance,
        "light_positions": capture.lights.position,
        "light_intensities": capture.lights.intensity,
        "mask": capture.mask(),
        "capture": np.bytes_((capture.folder / FILE).read_bytes()),
    }
    h5py = _h5py()
    sink = io.BytesIO()
    with h5py.File(sink, "w", track_order=True) as file:
        for name, values in arrays.items():
            packed = {"compression": "gzip"} if values.ndim else {}
            file.create_dataset(name, data=values, track_times=False, **packed)
    images.write_bytes(path, sink.getvalue())


def _pngs(capture: Capture, folder: Path) -> float:
    """Write pictures, mask and normals; return what radiance was multiplied by."""
    scale = _scale(capture)
    for light, name in enumerate(_names(len(capture))):
        exr.write_png(folder / name, scale * capture.image(light))
    mask = capture.mask()
    exr.write_png(folder / "mask.png", np.repeat(mask[..., None], 3, axis=-1).astype(np.float32), bits=8)
    normal = np.where(mask[..., None], np.nan_to_num(_truth(capture).normal), 0).astype(np.float64)
    _matlab(folder / "Normal_gt.mat", {"Normal_gt": normal})
    return scale


def _scale(capture: Capture) -> float:
    """Return what takes the brightest radiance, or the sensor's white, to 1."""
    if "saturation" in capture.notes:
        return 1.0
    brightest = max(float(capture.image(light).max()) for light in range(len(capture)))
    return 1 / brightest if brightest > 0 else 1.0


def _names(count: int) -> list[str]:
    return [f"{light:03d}.png" for light in range(1, count + 1)]


def _rows(values: NDArray[np.float64]) -> str:
    return "".join(" ".join(f"{value:.10g}" for value in row) + "\n" for row in values)


def _matlab(path: Path, values: dict[str, NDArray[Any]]) -> None:
    """Write a MATLAB file whose bytes depend on its values alone."""
    sink = io.BytesIO()
    savemat(sink, values)
    words = b"MATLAB 5.0 MAT-file".ljust(MATLAB_TEXT)
    images.write_bytes(path, words + sink.getvalue()[MATLAB_TEXT:])


def _truth(capture: Capture) -> Truth:
    truth = capture.truth()
    assert truth is not None
    return truth


def _h5py() -> Any:
    try:
        import h5py
    except ImportError as error:
        raise LightsphereError(
            "output.formats has 'hdf5', which needs h5py; install it: pip install 'lightsphere[dataset]'"
        ) from error
    return h5py
