"""`dropanchor`: one module of `commands` per subcommand."""

import argparse
import re
import sys
from collections.abc import Sequence

from dropanchor_service.commands import replay, router, serve

_DESCRIPTION = """\
Live positions of a fleet of tags around one dropped UWB anchor.
Tags publish raw ranges and IMU samples over Zenoh; the service answers with poses over Zenoh and REST.
"""
_EPILOG = """\
examples:
  dropanchor serve                         the service with a Zenoh router of its own, nothing to configure
  dropanchor replay RECORDING --anchor 7   the same estimator on a recording, with its error
  dropanchor COMMAND --help                everything about one command
"""


def main(arguments: Sequence[str] | None = None) -> int:
    """The exit code."""
    parser = argparse.ArgumentParser(
        "dropanchor",
        description=_DESCRIPTION,
        epilog=_EPILOG,
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, command in {"serve": serve, "router": router, "replay": replay}.items():
        one = commands.add_parser(
            name,
            help=command.HELP,
            description=command.DESCRIPTION,
            epilog=command.EPILOG,
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        command.add_arguments(one)
        one.set_defaults(run=command.run)
    chosen = parser.parse_args(_with_negative_values(sys.argv[1:] if arguments is None else arguments))
    return int(chosen.run(chosen))


def _with_negative_values(arguments: Sequence[str]) -> list[str]:
    """`--start -1,2,0` as `--start=-1,2,0`: argparse takes what begins with a minus for an option."""
    joined: list[str] = []
    for argument in arguments:
        if joined and re.fullmatch(r"--[a-z-]+", joined[-1]) and re.match(r"-\.?\d", argument):
            joined[-1] += f"={argument}"
        else:
            joined.append(argument)
    return joined
