"""The command line: `lightsphere STAGE ...`, `python -m pipeline`, `blender --command lightsphere`."""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence

import typer
from typer.exceptions import TyperException

from .commands import registry
from .core.errors import INPUT_AT_FAULT, LightsphereError

INTERRUPTED = 130

app = typer.Typer(
    name="lightsphere",
    help="Recover shape and reflectance from pictures under many lights, as Blender assets that Cycles relights.",
    add_completion=False,
    pretty_exceptions_enable=False,
)
registry.add_commands(app)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 2 the input is at fault, 130 interrupted."""
    if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:  # a script's background job; an interrupt sent to it is meant
        signal.signal(signal.SIGINT, signal.default_int_handler)
    words = list(sys.argv[1:] if arguments is None else arguments) or ["--help"]
    try:
        status = app(args=words, prog_name="lightsphere", standalone_mode=False)
    except LightsphereError as error:
        return _refuse(str(error))
    except TyperException as error:  # a wrong option or argument
        context = getattr(error, "ctx", None)
        command = context.command_path if context else "lightsphere"
        return _refuse(f"{' '.join(error.format_message().split()).rstrip('.')}; see {command} --help")
    except OSError as error:  # a closed folder, a full disk: the user's to mend
        return _refuse(f"{error}; check that the path exists, is open to you and has space left")
    except (KeyboardInterrupt, typer.Abort):
        status = INTERRUPTED
    if status == INTERRUPTED:  # typer turns an interrupt into this status
        print(
            "lightsphere: interrupted; what is finished is kept, the same command continues where it can",
            file=sys.stderr,
        )
    return int(status or 0)


def _refuse(message: str) -> int:
    print(f"lightsphere: {message}", file=sys.stderr)
    return INPUT_AT_FAULT
