"""`dropanchor`: one module of `commands` per subcommand; only the chosen one is imported."""

import argparse
import gc
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from dropanchor_service.runtime.kernel_cache import use_kernel_cache

_COMMANDS = {
    "demo": "the service with simulated tags, to look at in a browser",
    "serve": "run the service",
    "router": "run a Zenoh router alone",
    "security": "make the credentials of a site",
    "tag": "give tags their certificates, or take them away",
    "compile": "compile the estimator ahead of the first start",
    "key": "API keys of the REST interface",
    "record": "record what a service hears, and fetch the files",
    "replay": "run an engine on a recording, offline",
    "evaluate": "run the experiments of the paper, or the engines on real recordings",
}
_DESCRIPTION = """\
Live positions of a fleet of tags around one dropped UWB anchor.
Tags publish raw ranges and IMU samples over Zenoh; the service answers with poses over Zenoh and REST.
"""
_EVALUATION = ("matplotlib", "scipy", "sympy")
_EVALUATION_IS_MISSING = """\
This needs the extra 'evaluation': pip install 'dropanchor-service[evaluation]' (in a clone: make install)"""
_EPILOG = """\
examples:
  dropanchor demo                          the service with simulated tags: look at it in a browser
  dropanchor serve                         the service with a Zenoh router of its own, nothing to configure
  dropanchor replay RECORDING --anchor 1   the same estimator on a recording, with its error
  dropanchor evaluate paper --out report   the paper's experiments, its figures beside ours
  dropanchor COMMAND --help                everything about one command
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    try:
        return _run(arguments)
    except ModuleNotFoundError as error:
        if error.name not in _EVALUATION:
            raise
        print(_EVALUATION_IS_MISSING, file=sys.stderr)
        return 2


def _run(arguments: Sequence[str] | None) -> int:
    words = _with_negative_values(sys.argv[1:] if arguments is None else arguments)
    parser = argparse.ArgumentParser(
        "dropanchor",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, brief in _COMMANDS.items():
        one = commands.add_parser(name, help=brief, formatter_class=argparse.RawDescriptionHelpFormatter)
        if words[:1] == [name]:
            use_kernel_cache()  # before a command imports what is compiled
            command = _imported(f"dropanchor_service.commands.{name}")
            one.description, one.epilog = command.DESCRIPTION, command.EPILOG
            command.add_arguments(one)
            one.set_defaults(run=command.run)
    chosen = parser.parse_args(words)
    return int(chosen.run(chosen))


def _imported(name: str) -> ModuleType:
    """What is imported stays: looking through it for garbage again and again would take a tenth of the start."""
    gc.disable()
    try:
        return import_module(name)
    finally:
        gc.freeze()
        gc.enable()


def _with_negative_values(arguments: Sequence[str]) -> list[str]:
    """`--start -1,2,0` as `--start=-1,2,0`: argparse takes what begins with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[a-z-]+", joined[-1]) and re.match(r"-\.?\d", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
