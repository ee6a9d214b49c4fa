"""`lightsphere dataset` and `verify`: many captures from a recipe, and whether all their files are whole."""

from __future__ import annotations

import os
import queue
import sys
import tempfile
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Annotated

import typer

from ..core import images
from ..core.capture import FILE, Capture
from ..core.dataset import folder as files
from ..core.dataset.farm import Farm
from ..core.dataset.recipe import Recipe
from ..core.dataset.recipe import template as recipe_template
from ..core.dataset.run import Forecast, Hire, Made, forecast, make
from ..core.errors import LightsphereError
from ..core.progress import Progress, Work
from ..core.workers import Died, Worker, bound_to_few_cores
from .device import Device, render_on
from .stage import Figures, JsonFile, run_with_bar

SHEET = "datasheet.html"
SCALES = (10_000, 100_000, 1_000_000)  # samples that a dry run also tells of
NUMPY_THREADS = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS")
SHOWN = 10  # faults that are printed


def dataset(
    recipe: Annotated[Path | None, typer.Argument(help="a TOML file; --template prints one that explains all")] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="folder of the dataset")] = Path("dataset"),
    workers: Annotated[
        int, typer.Option(help="processes that render, 0: one per processor core, or one on a GPU", min=0, max=1024)
    ] = 0,
    scheduler: Annotated[
        str, typer.Option(help="of a Dask cluster that renders instead, e.g. tcp://host:8786", metavar="ADDRESS")
    ] = "",
    resume: Annotated[
        bool, typer.Option("--resume", help="go on with the dataset in the folder by the recipe it was begun with")
    ] = False,
    only: Annotated[
        list[int] | None,
        typer.Option(help="make this sample alone, as it is in the whole; may be said several times", metavar="NUMBER"),
    ] = None,
    dry_run: Annotated[
        bool, typer.Option("--dry-run", help="make a few samples elsewhere, and say what all of them would take")
    ] = False,
    template: Annotated[bool, typer.Option("--template", help="print a recipe with all that one may say")] = False,
    device: Device = "auto",
    json: JsonFile = None,
) -> None:
    """Make many captures of drawn shapes, materials, lights and cameras; run it again to make what is missing.

    Every sample depends on the recipe, its seed and its own number alone: not on workers, order or interruptions.
    Samples that cannot be made are listed in missing.json, with the reasons; the others are made.
    """
    if template:
        print(recipe_template(), end="")
        return
    with Figures("dataset", json) as figures:
        chosen = _chosen(recipe, output, resume)
        figures.values["device"] = render_on(device)
        from ..blender import devices
        from ..blender.dataset import formats, made_by

        count = workers or (1 if devices.chosen().is_gpu else os.cpu_count() or 1)
        if dry_run:
            _foretell(chosen, count, device, figures)
            return
        numbers = sorted(set(only or range(chosen.count)))
        if not 0 <= numbers[0] <= numbers[-1] < chosen.count:
            raise LightsphereError(f"--only takes numbers of samples, from 0 to {chosen.count - 1}")
        formats.library_for(chosen.output.formats)
        with files.alone(output):
            files.begin(output, chosen, made_by())
            made = run_with_bar(_made(output, chosen, numbers, _crew(output, count, scheduler, device)))
        figures.values |= {"samples": len(made.samples), "made": made.new, "pictures": _pictures(made)}
        figures.values["missing"] = {str(index): why for index, why in sorted(made.missing.items())}
        figures.summary = f"{len(made.samples)} samples, {made.new} of them new, in {output}; see {SHEET}"
    if made.missing:
        index, why = min(made.missing.items())
        raise LightsphereError(
            f"{len(made.missing)} of {len(numbers)} samples are missing, the first is {index}: {why}. "
            f"{output / files.MISSING} lists them; go on by --resume"
        )


def dataset_worker(
    folder: Annotated[Path, typer.Argument(help="folder of the dataset, begun by another process")],
    threads: Annotated[int, typer.Option(help="threads that render")] = 1,
    device: Device = "cpu",
) -> None:
    """Make the samples whose numbers arrive on standard input; say when each is done."""
    with bound_to_few_cores(threads):
        from ..blender.dataset import sample
    render_on(device)
    recipe = files.recipe_of(folder)
    print("ready", flush=True)
    for line in sys.stdin:
        try:
            sample.make(recipe, folder, int(line), threads)
            print("sample", int(line), flush=True)
        except (LightsphereError, OSError) as error:  # the latter of a full disk or a closed folder
            print("error", " ".join(str(error).split()), flush=True)


def verify(
    folder: Annotated[Path, typer.Argument(help="a dataset or a capture")],
    json: JsonFile = None,
) -> None:
    """Check every file of a dataset or a capture against the checksum that was noted when it was written."""
    with Figures("verify", json) as figures:
        is_capture = (folder / FILE).is_file()
        wrong = _wrong_with(Capture.open(folder)) if is_capture else run_with_bar(files.verify(folder))
        figures.values["wrong"] = wrong
        figures.summary = f"all files of {folder} are as they were written"
        if wrong:
            print(*wrong[:SHOWN], *(["..."] if len(wrong) > SHOWN else []), sep="\n")
            figures.summary = f"{len(wrong)} faults in {folder}"
    if wrong:
        raise LightsphereError(f"{folder} has {len(wrong)} faults; the command that made it makes it whole again")


def _crew(folder: Path, count: int, scheduler: str, device: str) -> Hire:
    """Return what takes on processes of this machine, or the workers of a cluster."""

    def local(samples: Sequence[int]) -> Farm:
        processes = min(count, len(samples))
        threads = max(1, (os.cpu_count() or 1) // processes)
        return Farm(processes, lambda: worker(folder, threads, device), samples)

    if not scheduler:
        return local
    from .cluster import Cluster

    return lambda samples: Cluster(scheduler, folder.resolve(), device, samples)


def worker(folder: Path, threads: int, device: str) -> Worker:
    """Start a process that makes samples of a dataset."""
    from ..blender.workers import command_line

    words = ("dataset-worker", str(folder), "--threads", str(threads), "--device", device)
    arguments, environment = command_line(*words, threads=threads)
    return Worker(arguments, environment | dict.fromkeys(NUMPY_THREADS, str(threads)))


def _chosen(recipe: Path | None, output: Path, resume: bool) -> Recipe:
    if recipe is not None:
        return Recipe.read(recipe)
    if resume:
        return files.recipe_of(output)
    raise LightsphereError("a recipe is missing; lightsphere dataset --template prints one")


def _made(folder: Path, recipe: Recipe, numbers: Sequence[int], hire: Hire) -> Work[Made]:
    from ..report.dataset import report

    made = yield from make(folder, recipe, numbers, hire)
    images.write_text(folder / SHEET, report(folder, recipe, made.samples))
    files.list_shared(folder, [folder / SHEET, folder / files.MANIFEST, *made.shared])
    return made


def _pictures(made: Made) -> int:
    return sum(sample.lights for sample in made.samples)


def _foretell(recipe: Recipe, count: int, device: str, figures: Figures) -> None:
    """Make a few samples where they disturb nobody, and say what all would take."""
    count = min(count, recipe.count)
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        files.begin(folder, recipe, {})
        found, start = run_with_bar(_tried(folder, recipe, count, device))
    seconds = found.seconds / count + start
    figures.values |= {
        "renders": found.renders,
        "expected_seconds": seconds,
        "expected_bytes": found.size,
        "seconds_a_sample": found.seconds / recipe.count,
        "bytes_a_sample": found.size / recipe.count,
        "seconds_to_start": start,
    }
    print("samples    hours of one process    disk")
    for samples in (recipe.count, *SCALES):
        share = samples / recipe.count
        print(f"{samples:<10,} {share * found.seconds / 3600:<23,.2f} {_bytes(share * found.size)}")
    figures.summary = (
        f"dry run: {recipe.count:,} samples, {found.renders:,} renders, about {_time(seconds)} with {count} workers, "
        f"{_bytes(found.size)}"
    )


def _tried(folder: Path, recipe: Recipe, count: int, device: str) -> Work[tuple[Forecast, float]]:
    """Return the forecast, and how long processes take until each has made its first sample [s]."""
    start = time.perf_counter()
    free: queue.SimpleQueue[Worker] = queue.SimpleQueue()
    processes = [worker(folder, max(1, (os.cpu_count() or 1) // count), device) for _ in range(count)]

    def timed(index: int) -> float:
        process, begun = free.get(), time.perf_counter()
        _asked(process, index)
        free.put(process)
        return time.perf_counter() - begun

    try:
        with ThreadPoolExecutor(count) as pool:
            list(pool.map(lambda process: _asked(process, 0), processes))
            started = time.perf_counter() - start
            yield Progress("start", 1, 1)
            for process in processes:
                free.put(process)
            return (yield from forecast(recipe, folder, count, lambda chosen: pool.map(timed, chosen))), started
    finally:
        for process in processes:
            process.kill()
            process.close()


def _asked(process: Worker, index: int) -> None:
    """Let a process make a sample on trial; raise LightsphereError where it dies of it."""
    try:
        process.ask(index, "sample")
    except Died as death:
        raise LightsphereError(
            f"the process that tried sample {index} ended with status {death.status}: {death.words}; a run would list "
            "the sample and go on"
        ) from death


def _wrong_with(capture: Capture) -> list[str]:
    return [f"{name} is missing or damaged" for name in capture.damaged()]


def _bytes(size: float) -> str:
    for unit in ("B", "kB", "MB", "GB"):
        if size < 1000:
            return f"{size:.3g} {unit}"
        size /= 1000
    return f"{size:,.3g} TB"


def _time(seconds: float) -> str:
    if seconds < 120:
        return f"{seconds:.0f} s"
    return f"{seconds / 60:.0f} min" if seconds < 7200 else f"{seconds / 3600:,.1f} h"
