"""`dropanchor security`: create and renew the credentials of a site."""

import argparse
import ipaddress
import re
import socket
from pathlib import Path

from dropanchor_schemas.file_names import file_name_of
from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_service.answers.connect_command import reachable_endpoint
from dropanchor_service.commands.options import positive
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.security.issued import Table

DESCRIPTION = """\
Creates a folder with the credentials of a site: a certificate authority (ca), certificates for router, service and
reader, and a router configuration that allows each tag to publish only its own samples. It never overwrites a file.
Keep the folder private. Only new certificates need ca.key: store it elsewhere in between.
"""
EPILOG = """\
examples:
  dropanchor security init --host yard.example --host 192.168.1.10
  dropanchor security init --security /etc/dropanchor --site yard --host yard.example
  dropanchor security add-site annexe          a second site of the same router and service
  dropanchor security renew
"""
FOLDER = Path("security")
DAYS = 730
REFUSED = (SecurityError, InvalidKeyError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    init = actions.add_parser("init", help="create the credentials", description=DESCRIPTION, epilog=EPILOG)
    init.formatter_class = argparse.RawDescriptionHelpFormatter
    add_folder_option(init)
    init.add_argument("--site", default="default", help="id of the site (default: %(default)s)")
    init.add_argument(
        "--host",
        action="append",
        default=[],
        metavar="NAME",
        help="name or address of this machine for tags and browsers; may be repeated",
    )
    init.add_argument(
        "--listen",
        default="tls/0.0.0.0:7447",
        metavar="ENDPOINT",
        help="endpoint of the router (default: %(default)s)",
    )
    add_days_option(init)
    renew = actions.add_parser("renew", help="renew the certificates of router, service and reader before they expire")
    add_folder_option(renew)
    renew.add_argument("--host", action="append", default=[], metavar="NAME", help="an additional name, as with init")
    add_days_option(renew)
    site = actions.add_parser("add-site", help="let the router and the service have another site")
    site.add_argument("name", metavar="NAME", help="id of the site")
    add_folder_option(site)
    add_days_option(site)


def add_site_option(parser: argparse.ArgumentParser, what: str) -> None:
    parser.add_argument("--site", help=what)


def add_folder_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--security",
        type=Path,
        default=FOLDER,
        metavar="FOLDER",
        help="folder of the credentials (default: ./%(default)s)",
    )


def add_days_option(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--days",
        type=positive,
        default=DAYS,
        metavar="N",
        help="days until the certificates expire (default: %(default)s)",
    )


def run(arguments: argparse.Namespace) -> None:
    """Run the action. Raises REFUSED."""
    {"init": _init, "renew": _renew, "add-site": _add_site}[arguments.action](arguments)


def _init(arguments: argparse.Namespace) -> None:
    file_name_of(arguments.site)
    hosts = _hosts(arguments.host)
    table = Table(site=arguments.site, hosts=hosts, listen=(arguments.listen,))
    SecurityFolder.make(arguments.security, table, arguments.days)
    print(_next_steps(arguments.security, table))


def _renew(arguments: argparse.Namespace) -> None:
    folder = SecurityFolder.open(arguments.security)
    folder.renew(_checked(arguments.host), arguments.days)
    print(f"Router, service and reader have new certificates for {', '.join(folder.table.hosts)}.")
    print("Restart each of them to use the new certificates. To renew a tag's: dropanchor tag add NAME --renew")


def _add_site(arguments: argparse.Namespace) -> None:
    folder, site = SecurityFolder.open(arguments.security), arguments.name
    folder.add_site(site, arguments.days)
    print(f"The router of {folder.path} serves {', '.join(folder.table.sites)} after a restart.")
    print(f"Its tags: dropanchor tag add NAME --site {site}. Keys for it alone: dropanchor key add NAME --site {site}")


def _hosts(given: list[str]) -> tuple[str, ...]:
    """Return all host names, the given ones first: tags connect to the first one."""
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
The credentials of site {site!r} are in {folder}/. The certificates are valid for: {", ".join(table.hosts)}.
Next steps:
  1. a tag:      dropanchor tag add NAME --security {folder}
                 then copy the folder {folder}/tags/NAME to the tag over a trusted channel
  2. the router: dropanchor router --security {folder}        restart it after tags were added or revoked
  3. the service: dropanchor serve --security {folder} --zenoh-connect {reachable_endpoint(table.listen[0])}{of_site}
  4. the page and REST (https, with the certificate {folder}/ca.pem): dropanchor key add NAME --security {folder}
"""
