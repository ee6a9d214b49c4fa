"""What every command does alike: options made from settings, a progress bar, one summary line, `--json`."""

from __future__ import annotations

import dataclasses
import inspect
import json
import math
import os
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from operator import attrgetter
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, ProgressColumn, Task, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar
from rich.table import Column, Table
from rich.text import Text

from ..core import images
from ..core.progress import Progress, Work, finish
from ..core.settings import check, limits_of
from ..core.tradeoff import Trial, as_row, dominated
from ..core.tradeoff.goal import Promise, stated, told, unit
from ..core.tradeoff.presets import presets

Budget = Annotated[
    float | None,
    typer.Option(
        help="instead of settings: the time that may pass, with settings of the least error within it [s]",
        metavar="SECONDS",
    ),
]
Target = Annotated[
    float | None,
    typer.Option(
        help="instead of settings: the error that will do, with the quickest settings that are expected to reach it, "
        "by trials on a part of the pixels [%; of normals: degrees]",
        metavar="ERROR",
    ),
]
DryRun = Annotated[
    bool,
    typer.Option(
        "--dry-run", help="do nothing but say what settings are expected to cost and give, by the same trials"
    ),
]
Result = TypeVar("Result")
Settings = TypeVar("Settings")

JsonFile = Annotated[
    Path | None, typer.Option("--json", help="write the figures of this run to a file", metavar="FILE")
]


def settings_options(settings_type: type[Any]) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command one option per field of a settings dataclass; the command receives them as ``settings``.

    A field ``radius_inner`` becomes ``--radius-inner``, its help, unit, limits and default from the field.
    """

    def decorate(command: Callable[..., None]) -> Callable[..., None]:
        signature = inspect.signature(command, eval_str=True)
        parameters = [p for p in signature.parameters.values() if p.name != "settings"]
        for item in dataclasses.fields(settings_type):
            limits = limits_of(item)
            words = limits.help + (f" [{limits.unit}]" if limits.unit else "")
            if limits.choices:
                words += f": {', '.join(limits.choices)}"
            names = [f"--{item.name.replace('_', '-')}"]
            if isinstance(item.default, bool):
                names = [f"{names[0]}/--no-{names[0][2:]}"]
            if limits.short:
                names.append(limits.short)
            kind = type(item.default)
            parameters.append(
                inspect.Parameter(
                    item.name,
                    inspect.Parameter.KEYWORD_ONLY,
                    default=item.default,
                    annotation=Annotated[kind, typer.Option(*names, help=words)],
                )
            )

        def run(**values: Any) -> None:
            chosen = {f.name: values.pop(f.name) for f in dataclasses.fields(settings_type)}
            command(settings=check(settings_type(**chosen)), **values)

        run.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
            [p.replace(kind=inspect.Parameter.KEYWORD_ONLY) for p in parameters]
        )
        run.__annotations__ = {p.name: p.annotation for p in parameters}
        run.__name__ = command.__name__
        run.__doc__ = command.__doc__
        return run

    return decorate


def run_with_bar(work: Work[Result], one_bar: bool = False) -> Result:
    """Run long work with a bar, rate and time left on a terminal; silently where there is none.

    Every stage of the work has a bar of its own, or all share one that names the stage at hand.

    With the environment variable ``LIGHTSPHERE_PROGRESS=json`` every step is one line of JSON on standard
    output instead: how a worker process tells Blender's window how far it is.
    """
    if os.environ.get("LIGHTSPHERE_PROGRESS") == "json":
        return finish(work, JsonLines())
    columns = (
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        Rate(),
        TimeRemainingColumn(),
    )
    # A stream of its own: while Cycles renders, what goes to standard error is Blender's and is held back.
    with (
        os.fdopen(os.dup(2), "w", encoding="utf-8") as stream,
        Bar(*columns, disable=not stream.isatty(), console=Console(file=stream)) as bar,
    ):
        tasks: dict[str, Any] = {}

        def report(step: Progress) -> None:
            key = "" if one_bar else step.stage
            if key not in tasks:
                tasks[key] = bar.add_task(step.stage, total=step.total, unit=step.unit)
            bar.update(tasks[key], completed=step.done, total=step.total, description=step.stage)

        return finish(work, report)


class Rate(ProgressColumn):
    """The unit of the work and how much of it is done a second."""

    def render(self, task: Task) -> Text:
        speed = task.finished_speed or task.speed
        return Text(f"{task.fields['unit']}  " + (f"{speed:.3g}/s" if speed else ""))


class JsonLines:
    """Print steps as lines of JSON, at most ten a second, the first and last step of a stage always."""

    def __init__(self) -> None:
        self._stage = ""
        self._printed = 0.0

    def __call__(self, step: Progress) -> None:
        now = time.monotonic()
        if step.stage == self._stage and step.done < step.total and now - self._printed < 0.1:
            return
        self._stage, self._printed = step.stage, now
        print(json.dumps(dataclasses.asdict(step)), flush=True)


def peak_memory_mb() -> float | None:
    """Return the largest memory that this process or one of its finished children held [MB].

    None on Windows, where the standard library does not know it.
    """
    try:
        import resource
    except ImportError:
        return None
    most = max(resource.getrusage(who).ru_maxrss for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return most / (1024**2 if sys.platform == "darwin" else 1024)  # macOS counts bytes, Linux KiB


def as_json(values: Any) -> str:
    """Return figures as JSON that every reader takes: what is not a number (nothing was recovered, say) is null."""
    return json.dumps(_without_nan(values), indent=1, allow_nan=False)


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _without_nan(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_trials(
    trials: Sequence[Trial], beaten: Sequence[str], columns: Mapping[str, Callable[[Trial], float]]
) -> None:
    """Print a table of trials; beside what they cost, columns by their headings, and which other beats each."""
    table = Table(Column("settings", no_wrap=True), "seconds", *columns, "beaten by")
    for trial, better in zip(trials, beaten, strict=True):
        numbers = (trial.seconds, *(number(trial) for number in columns.values()))
        table.add_row(trial.label, *(f"{number:.3g}" for number in numbers), better)
    Console().print(table)


class Figures:
    """The figures of one run: seconds and peak memory by themselves, others as they are found.

    Use as a context manager around the work; on leaving, prints the summary line and writes ``--json``.
    """

    def __init__(self, stage: str, json_file: Path | None) -> None:
        self.stage = stage
        self.json_file = json_file
        self.values: dict[str, Any] = {}
        self.summary = ""
        self.promise: Promise | None = None
        self._start = time.perf_counter()

    def obtained(self, errors: dict[str, float]) -> None:
        """State what was promised for a goal, if there was one, and the errors that were obtained."""
        if self.promise is not None:
            self.values["promise"] = kept = self.promise.kept(errors)
            self.summary += f"; {told(kept)}"

    def foreseen(self, promise: Promise, asked: float | None = None) -> None:
        """State what settings are expected to cost and give, and which are chosen: all that a dry run does.

        An error that the settings ask for [%] is that of the preset Standard.
        """
        name = promise.expected.error
        beaten = dominated(promise.trials)
        columns = {f"{name} [{unit(name)}]": stated, "recovered [%]": attrgetter("recovered_pct")}
        print_trials(promise.trials, beaten, columns)
        rows = [as_row(trial, better) for trial, better in zip(promise.trials, beaten, strict=True)]
        named = presets(promise.trials, asked)
        self.values |= {
            "trials": rows,
            "presets": named,
            "chosen": promise.expected.label,
            "lacks": promise.lacks,
        }
        words = ", ".join(f"{preset} {one['label']}" for preset, one in named.items())
        wanted = promise.expected.label if promise.goal else "nothing chosen: give --budget or --target"
        self.summary = f"dry run; {words}; {wanted}" + (f"; {promise.lacks}" if promise.lacks else "")

    def __enter__(self) -> Figures:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> None:
        if kind is not None:
            return
        seconds = time.perf_counter() - self._start
        values = {"seconds": seconds, "peak_memory_mb": peak_memory_mb(), **self.values}
        if self.json_file is not None:
            images.write_text(self.json_file, as_json(values))
        print(f"{self.stage}: {self.summary} ({seconds:.1f} s)")
