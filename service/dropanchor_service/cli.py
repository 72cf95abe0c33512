"""`dropanchor`: one module of `commands` per subcommand."""

import argparse
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
    chosen = parser.parse_args(arguments)
    return int(chosen.run(chosen))
