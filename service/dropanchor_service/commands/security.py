"""`dropanchor security`: the credentials of a site."""

import argparse
import ipaddress
import re
import socket
import sys
from pathlib import Path

from dropanchor_schemas.keys import InvalidKeyError, chunk_from_id
from dropanchor_service.answers.connect_command import reachable_endpoint
from dropanchor_service.commands.options import positive
from dropanchor_service.security.folder import SecurityError, SecurityFolder, Table

DESCRIPTION = """\
Makes the credentials of a site, in a folder: a certificate authority (ca), certificates for router, service and reader,
and a router configuration by which every tag may speak for itself alone. Nothing is ever overwritten.
Keep the folder to yourself; ca.key is needed only to add tags and may be kept elsewhere meanwhile.
"""
EPILOG = """\
examples:
  dropanchor security init --host yard.example --host 192.168.1.10
  dropanchor security init --security /etc/dropanchor --site yard --host yard.example
  dropanchor security renew
"""
FOLDER = Path("security")
DAYS = 730
UNUSABLE = 2


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    init = actions.add_parser("init", help="make them", description=DESCRIPTION, epilog=EPILOG)
    init.formatter_class = argparse.RawDescriptionHelpFormatter
    add_folder_option(init)
    init.add_argument("--site", default="default", help="id of the site (default: %(default)s)")
    init.add_argument(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="name or address by which tags and browsers reach this machine; may be repeated",
    )
    init.add_argument(
        "--listen",
        default="tls/0.0.0.0:7447",
        metavar="ENDPOINT",
        help="where the router listens (default: %(default)s)",
    )
    add_days_option(init)
    renew = actions.add_parser(
        "renew", help="new certificates of router, service and reader, before the old ones expire"
    )
    add_folder_option(renew)
    renew.add_argument("--host", action="append", default=[], metavar="NAME", help="one more, as with init")
    add_days_option(renew)


def add_folder_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--security", type=Path, default=FOLDER, metavar="FOLDER", help="the credentials (default: ./%(default)s)"
    )


def add_days_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--days", type=positive, default=DAYS, metavar="N", help="certificates are valid for so long (%(default)s)"
    )


def run(arguments: argparse.Namespace) -> int:
    """0, or 2 when nothing was made."""
    try:
        {"init": _init, "renew": _renew}[arguments.action](arguments)
    except (SecurityError, InvalidKeyError, OSError) as error:
        sys.stderr.write(f"dropanchor security: {error}\n")
        return UNUSABLE
    return 0


def _init(arguments: argparse.Namespace) -> None:
    chunk_from_id(arguments.site)
    hosts = _hosts(arguments.host)
    table = Table(site=arguments.site, hosts=hosts, listen=(arguments.listen,))
    SecurityFolder.make(arguments.security, table, arguments.days)
    print(_next_steps(arguments.security, table))


def _renew(arguments: argparse.Namespace) -> None:
    folder = SecurityFolder.open(arguments.security)
    folder.renew(_checked(arguments.host), arguments.days)
    print(f"Router, service and reader have new certificates for {', '.join(folder.table.hosts)}.")
    print("In force after a restart of each. Tags keep theirs: dropanchor tag add NAME --renew")


def _hosts(given: list[str]) -> tuple[str, ...]:
    """Those that were given first: a tag is told to connect to the first one."""
    return tuple(dict.fromkeys([*_checked(given), socket.gethostname(), "localhost", "127.0.0.1", "::1"]))


def _checked(hosts: list[str]) -> list[str]:
    for host in hosts:
        if not (_is_address(host) or re.fullmatch(r"[A-Za-z0-9.-]+", host)):
            raise SecurityError(f"--host {host!r} is neither the name nor the address of a machine")
    return hosts


def _is_address(host: str) -> bool:
    try:
        ipaddress.ip_address(host)
    except ValueError:
        return False
    return True


def _next_steps(folder: Path, table: Table) -> str:
    site = table.site
    of_site = "" if site == "default" else f"\n     (with [site] id = {site!r} in its settings)"
    return f"""\
The credentials of site {site!r} are in {folder}/. The certificates are good for: {", ".join(table.hosts)}.
Next:
  1. a tag:      dropanchor tag add NAME --security {folder}
                 and give the folder {folder}/tags/NAME to it, over a channel that you trust
  2. the router: dropanchor router --security {folder}        again after tags were added or revoked
  3. the service: dropanchor serve --security {folder} --zenoh-connect {reachable_endpoint(table.listen[0])}{of_site}
  4. the page and REST (https, with the certificate {folder}/ca.pem): dropanchor key add NAME --security {folder}
"""
