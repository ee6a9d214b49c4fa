"""Somebody else's published solver on a dataset in DiLiGenT's layout, unchanged, beside ours on the same samples.

The solver is RobustPhotometricStereo of Yasuyuki Matsushita (github.com/yasumat/RobustPhotometricStereo): least squares
(Woodham 1980), L1 residuals (Ikehata and others 2012), robust PCA (Wu and others 2010). Two steps, as it needs packages
that we do not::

    lightsphere dataset tests/benchmarks/other_solver.toml -o made
    pip install scikit-learn opencv-python-headless scipy   # in an environment of its own
    python tests/benchmarks/other_solver.py made --theirs PATH_OF_ITS_FOLDER
    .venv-3.13/bin/python tests/benchmarks/other_solver.py made

The first writes their normals beside the dataset's, the second adds ours and prints the table of mean angular errors.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.io import loadmat

METHODS = {"least squares": "L2_SOLVER", "L1": "L1_SOLVER", "robust PCA": "RPCA_SOLVER"}
OURS = ("lambertian", "acls")
THEIRS = "theirs.npz"


def main() -> None:
    """Run their solver, or ours and print the table."""
    parser = argparse.ArgumentParser(description="Somebody else's solver and ours on the same dataset.")
    parser.add_argument("dataset", type=Path)
    parser.add_argument("--theirs", type=Path, help="folder of their rps.py; runs it, too")
    given = parser.parse_args()
    folders = sorted((given.dataset / "diligent").iterdir())
    if given.theirs is not None:
        sys.path.insert(0, str(given.theirs))
        for folder in folders:
            np.savez(given.dataset / f"{folder.name}-{THEIRS}", **_their_normals(folder))
        return
    print(f"{'sample':14}" + "".join(f"{name:>16}" for name in (*METHODS, *(f"our {name}" for name in OURS))))
    rows = []
    for folder in folders:
        with np.load(given.dataset / f"{folder.name}-{THEIRS}") as theirs:
            errors = [_error(theirs[name], folder) for name in METHODS]
        rows.append([*errors, *(_error(_our_normals(folder, given.dataset, method), folder) for method in OURS)])
        print(f"{folder.name:14}" + "".join(f"{error:16.2f}" for error in rows[-1]), flush=True)
    for name, of in (("mean", np.mean), ("median", np.median)):
        print(f"{name:14}" + "".join(f"{error:16.2f}" for error in of(rows, axis=0)))


def _their_normals(folder: Path) -> dict[str, np.ndarray]:
    from rps import PMS

    found = {}
    for name, method in METHODS.items():
        solver = PMS()
        solver.load_mask(str(folder / "mask.png"))
        solver.load_lighttxt(str(folder / "light_directions.txt"))
        solver.load_images(f"{folder}/0", "png")  # 001.png and on, and not the mask
        solver.solve(getattr(PMS, method))
        found[name] = solver.N.reshape(solver.height, solver.width, 3)
    return found


def _our_normals(folder: Path, place: Path, method: str) -> np.ndarray:
    sys.path.insert(0, str(Path(__file__).resolve().parents[2]))
    from pipeline import cli
    from pipeline.core.shape import Shape

    capture, shape = place / "ours" / folder.name, place / "ours" / f"{folder.name}-{method}"
    assert cli.main(["import", str(folder), "-o", str(capture)]) == 0
    assert cli.main(["shape", str(capture), "-o", str(shape), "--method", method]) == 0
    return np.asarray(Shape.open(shape).normal)


def _error(normal: np.ndarray, folder: Path) -> float:
    """Return the mean angle to the truth over the object [degrees]; what was not recovered counts as 90."""
    truth = loadmat(folder / "Normal_gt.mat")["Normal_gt"]
    cosine = np.clip((normal * truth).sum(axis=-1), -1, 1)[np.linalg.norm(truth, axis=-1) > 0.5]
    return float(np.degrees(np.arccos(np.nan_to_num(cosine))).mean())


if __name__ == "__main__":
    main()
