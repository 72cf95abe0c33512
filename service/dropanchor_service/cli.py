"""The command `dropanchor`. Each subcommand is a module of `commands`; only the chosen one is imported."""

import argparse
import gc
import re
import sys
from collections.abc import Container, Sequence
from functools import partial
from importlib import import_module
from keyword import iskeyword
from types import ModuleType
from typing import Any

from dropanchor_service.commands.early import data_dir_of
from dropanchor_service.runtime.kernel_cache import use_kernel_cache
from dropanchor_tag_client.command_line import (
    COMPLETION,
    Parser,
    add_completion_arguments,
    completion_script,
    explain_actions,
)

_COMMANDS = {
    "demo": "run the service with simulated tags and watch them in a browser",
    "serve": "run the service",
    "check": "check the settings, credentials, folders and ports of a service without starting it",
    "status": "show how a running service and its tags do",
    "doctor": "find out what is wrong with a running service, or with one of its tags",
    "router": "run a separate Zenoh router",
    "api": "run an API node of a cluster: the page and REST of all its sites",
    "cluster": "run sites on several machines: start, show, move, drain",
    "settings": "show every setting in force, where it comes from and what it hides",
    "security": "create the credentials of a site",
    "tag": "issue and revoke the certificates of tags",
    "compile": "compile the estimator ahead of the first start",
    "key": "manage API keys of the REST interface",
    "history": "move the history of a site from its file into a database",
    "backup": "copy data and credentials of a service, while it runs",
    "restore": "put a backup back in place",
    "record": "record the samples and poses of a service, and download the files",
    "import": "turn bags of ROS, exports of phones and tables into a recording",
    "replay": "run an engine on a recording, offline",
    "foxglove": "show the poses of a running service live in Foxglove or Lichtblick",
    "ros2": "make a robot with ROS 2 a tag, and publish its pose to ROS",
    "evaluate": "run the experiments of the paper, or the engines on real recordings",
}
_OF_OTHERS = {"evaluate": "dropanchor_evaluation"}  # commands that another package brings by an entry point
_DESCRIPTION = """\
Live positions of a fleet of tags around one dropped UWB anchor.
Tags publish raw ranges and IMU samples over Zenoh; the service provides their poses over Zenoh and REST.
"""
_EXTRAS = {
    "apsw": "ros2",
    "dropanchor_evaluation": "evaluation",
    "matplotlib": "evaluation",
    "scipy": "evaluation",
    "sympy": "evaluation",
    "foxglove": "foxglove",
    "psycopg": "postgresql",
    "pyarrow": "parquet",
    "ray": "cluster",
    "rosbags": "ros2",
    "xxhash": "ros2",
}
_EXTRA_IS_MISSING = """\
This needs the extra '{0}': pip install 'dropanchor-service[{0}]' (in a clone: make install)"""
EXIT_ERROR = 2
_EPILOG = """\
examples:
  dropanchor demo                          run the service with simulated tags and watch them in a browser
  dropanchor serve                         run the service with a built-in Zenoh router and default settings
  dropanchor import drive.bag --out DRIVE  turn a bag, an export of a phone or a table into a recording
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
        return EXIT_ERROR


def _run(arguments: Sequence[str] | None) -> int:
    words = _with_negative_values(sys.argv[1:] if arguments is None else arguments)
    chosen = _parser(words[:1], words).parse_args(words)
    if chosen.command == "completion":
        print(completion_script(_parser([name for name in _COMMANDS if _is_installed(name)]), chosen.shell))
        return 0
    try:
        return int(chosen.run(chosen) or 0)
    except chosen.refused as error:
        print(f"dropanchor {chosen.command}: {error}", file=sys.stderr)
        return EXIT_ERROR


def _parser(chosen: Container[str], words: Sequence[str] = ()) -> Parser:
    """Return the parser of the whole command line. Only the chosen commands get their options and are imported.

    words: the command line. A command raises one of its REFUSED for what a person has to mend.
    """
    parser = Parser("dropanchor", description=_DESCRIPTION, epilog=_EPILOG)
    parser.add_argument("--version", action=_Version, help="print the version and exit")
    commands = parser.add_subparsers(dest="command", required=True, metavar="COMMAND")
    for name, brief in _COMMANDS.items():
        one = commands.add_parser(name, help=brief)
        if name in chosen:
            use_kernel_cache(partial(data_dir_of, words))  # before a command imports compiled kernels
            command = _imported(name)
            one.description, one.epilog = command.DESCRIPTION, command.EPILOG
            command.add_arguments(one)
            explain_actions(one)
            one.set_defaults(run=command.run, refused=getattr(command, "REFUSED", ()))
    add_completion_arguments(commands.add_parser("completion", help=COMPLETION), "dropanchor")
    return parser


class _Version(argparse.Action):
    """Prints the version of the distribution, which is looked up only then."""

    def __init__(self, **options: Any) -> None:
        super().__init__(nargs=0, **options)

    def __call__(self, parser: argparse.ArgumentParser, *_: Any) -> None:
        from importlib.metadata import version

        print(f"dropanchor {version('dropanchor-service')}")
        parser.exit()


def _is_installed(command: str) -> bool:
    """Return whether the packages of a command are there: some commands need an extra."""
    try:
        _imported(command)
    except ModuleNotFoundError as error:
        if error.name not in _EXTRAS:
            raise
        return False
    return True


def _imported(command: str) -> ModuleType:
    """Import the module of a command. A name that is a keyword of Python has an underscore there.

    The garbage collector is off meanwhile: imported objects stay, and collecting costs 10 % of the start.
    """
    gc.disable()
    try:
        if command in _OF_OTHERS:
            return _of_another_package(command)
        return import_module(f"dropanchor_service.commands.{command}{'_' if iskeyword(command) else ''}")
    finally:
        gc.freeze()
        gc.enable()


def _of_another_package(command: str) -> ModuleType:
    """Import a command that has an entry point. Raises ModuleNotFoundError where its package is not installed."""
    from importlib.metadata import entry_points

    for found in entry_points(group="dropanchor.commands", name=command):
        module: ModuleType = found.load()
        return module
    raise ModuleNotFoundError(f"no package has the command {command}", name=_OF_OTHERS[command])


def _with_negative_values(arguments: Sequence[str]) -> list[str]:
    """Turn `--start -1,2,0` into `--start=-1,2,0`, because argparse takes an argument with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[a-z-]+", joined[-1]) and re.match(r"-\.?\d", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
