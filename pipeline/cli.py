"""The command line: `lightsphere STAGE ...`, `python -m pipeline`, `blender --command lightsphere`."""

from __future__ import annotations

import sys
from collections.abc import Sequence

import click
import typer

from .commands import registry
from .core.errors import LightsphereError

INPUT_AT_FAULT = 2
INTERRUPTED = 130

app = typer.Typer(
    name="lightsphere",
    help="Recover shape and reflectance from pictures under many lights, as Blender assets that Cycles relights.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
registry.add_commands(app)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 2 the input is at fault, 130 interrupted."""
    try:
        app(args=list(sys.argv[1:] if arguments is None else arguments), prog_name="lightsphere", standalone_mode=False)
    except LightsphereError as error:
        print(f"lightsphere: {error}", file=sys.stderr)
        return INPUT_AT_FAULT
    except click.ClickException as error:
        error.show()
        return INPUT_AT_FAULT
    except (KeyboardInterrupt, click.Abort):
        print("lightsphere: interrupted; what is finished is kept, the same command continues it", file=sys.stderr)
        return INTERRUPTED
    return 0
