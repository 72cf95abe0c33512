"""The command `dropanchor`. Each subcommand is a module of `commands`; only the chosen one is imported."""

import argparse
import gc
import re
import sys
from collections.abc import Sequence
from importlib import import_module
from types import ModuleType

from dropanchor_service.runtime.kernel_cache import use_kernel_cache

_COMMANDS = {
    "demo": "run the service with simulated tags and watch them in a browser",
    "serve": "run the service",
    "router": "run a separate Zenoh router",
    "security": "create the credentials of a site",
    "tag": "issue and revoke the certificates of tags",
    "compile": "compile the estimator ahead of the first start",
    "key": "manage API keys of the REST interface",
    "record": "record the samples and poses of a service, and download the files",
    "replay": "run an engine on a recording, offline",
    "foxglove": "show the poses of a running service live in Foxglove or Lichtblick",
    "ros2": "make a robot with ROS 2 a tag, and publish its pose to ROS",
    "evaluate": "run the experiments of the paper, or the engines on real recordings",
}
_DESCRIPTION = """\
Live positions of a fleet of tags around one dropped UWB anchor.
Tags publish raw ranges and IMU samples over Zenoh; the service provides their poses over Zenoh and REST.
"""
_EXTRAS = {
    "matplotlib": "evaluation",
    "scipy": "evaluation",
    "sympy": "evaluation",
    "foxglove": "foxglove",
    "rosbags": "ros2",
    "xxhash": "ros2",
}
_EXTRA_IS_MISSING = """\
This needs the extra '{0}': pip install 'dropanchor-service[{0}]' (in a clone: make install)"""
_EPILOG = """\
examples:
  dropanchor demo                          run the service with simulated tags and watch them in a browser
  dropanchor serve                         run the service with a built-in Zenoh router and default settings
  dropanchor replay RECORDING --anchor 1   run the same estimator on a recording and report its error
  dropanchor evaluate paper --out report   run the paper's experiments and compare the figures
  dropanchor COMMAND --help                show all options of a command
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command and return its exit code."""
    try:
        return _run(arguments)
    except ModuleNotFoundError as error:
        if error.name not in _EXTRAS:
            raise
        print(_EXTRA_IS_MISSING.format(_EXTRAS[error.name]), file=sys.stderr)
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
            use_kernel_cache()  # before a command imports compiled kernels
            command = _imported(f"dropanchor_service.commands.{name}")
            one.description, one.epilog = command.DESCRIPTION, command.EPILOG
            command.add_arguments(one)
            one.set_defaults(run=command.run)
    chosen = parser.parse_args(words)
    return int(chosen.run(chosen))


def _imported(name: str) -> ModuleType:
    """Import a module with the garbage collector off. Imported objects stay, and collecting costs 10 % of the start."""
    gc.disable()
    try:
        return import_module(name)
    finally:
        gc.freeze()
        gc.enable()


def _with_negative_values(arguments: Sequence[str]) -> list[str]:
    """Turn `--start -1,2,0` into `--start=-1,2,0`, because argparse takes an argument with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[a-z-]+", joined[-1]) and re.match(r"-\.?\d", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
