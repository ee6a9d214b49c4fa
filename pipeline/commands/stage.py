"""What every command does alike: options made from settings, a progress bar, one summary line, `--json`."""

from __future__ import annotations

import dataclasses
import inspect
import json
import resource
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, TypeVar

import typer
from rich.progress import BarColumn, MofNCompleteColumn, TextColumn, TimeRemainingColumn
from rich.progress import Progress as Bar

from ..core import images
from ..core.progress import Progress, Work, finish
from ..core.settings import check, limits_of

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


def run_with_bar(work: Work[Result]) -> Result:
    """Run long work with a bar, rate and time left on a terminal; silently where there is none."""
    columns = (
        TextColumn("{task.description:<12}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[unit]}  {task.fields[rate]}"),
        TimeRemainingColumn(),
    )
    with Bar(*columns, disable=not sys.stderr.isatty(), console=_stderr()) as bar:
        tasks: dict[str, Any] = {}

        def report(step: Progress) -> None:
            if step.stage not in tasks:
                tasks[step.stage] = bar.add_task(step.stage, total=step.total, unit=step.unit, rate="")
            task = tasks[step.stage]
            speed = bar._tasks[task].finished_speed or bar._tasks[task].speed
            bar.update(task, completed=step.done, total=step.total, rate=f"{speed:.3g}/s" if speed else "")

        return finish(work, report)


def _stderr() -> Any:
    from rich.console import Console

    return Console(file=sys.stderr)


class Figures:
    """The figures of one run: seconds and peak memory by themselves, others as they are found.

    Use as a context manager around the work; on leaving, prints the summary line and writes ``--json``.
    """

    def __init__(self, stage: str, json_file: Path | None) -> None:
        self.stage = stage
        self.json_file = json_file
        self.values: dict[str, Any] = {}
        self.summary = ""
        self._start = time.perf_counter()

    def __enter__(self) -> Figures:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: Any) -> None:
        if kind is not None:
            return
        seconds = time.perf_counter() - self._start
        own = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
        children = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
        values = {"seconds": seconds, "peak_memory_mb": max(own, children) / 1024, **self.values}
        if self.json_file is not None:
            images.write_text(self.json_file, json.dumps(values, indent=1))
        print(f"{self.stage}: {self.summary} ({seconds:.1f} s)")
