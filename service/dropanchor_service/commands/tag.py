"""`dropanchor tag`: issue and revoke the certificates of tags."""

import argparse
from pathlib import Path

from dropanchor_schemas.keys import InvalidKeyError
from dropanchor_service.commands.security import add_days_option, add_folder_option, add_site_option
from dropanchor_service.security.folder import ROUTER_FILE, SecurityError, SecurityFolder

DESCRIPTION = """\
Issues or revokes the certificate of a tag and updates the router's configuration. Zenoh reads its access control only
at the start, so restart the router afterwards. Tags and service reconnect by themselves, and nothing is lost.
"""
EPILOG = """\
examples:
  dropanchor tag add forklift-7
  dropanchor tag add forklift-7 --renew
  dropanchor tag add forklift-7 --site annexe      where the folder has several sites
  dropanchor tag revoke forklift-7
  dropanchor tag list
"""
REFUSED = (SecurityError, InvalidKeyError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    add = actions.add_parser("add", help="issue a certificate")
    add.add_argument("name", metavar="NAME", nargs="+", help="id of a tag")
    add.add_argument("--renew", action="store_true", help="replace the certificate of tags that have one")
    add_days_option(add)
    revoke = actions.add_parser("revoke", help="revoke a certificate")
    revoke.add_argument("name", metavar="NAME", nargs="+", help="id of a tag")
    listed = actions.add_parser("list", help="list the tags and their certificates")
    for action in (add, revoke):
        add_site_option(action, "site of the tags; needed where the folder has several")
    for action in (add, revoke, listed):
        add_folder_option(action)


def run(arguments: argparse.Namespace) -> None:
    """Run the action. Raises REFUSED."""
    folder = SecurityFolder.open(arguments.security)
    {"add": _add, "revoke": _revoke, "list": _list}[arguments.action](folder, arguments)


def _add(folder: SecurityFolder, arguments: argparse.Namespace) -> None:
    for name in arguments.name:
        bundle = folder.add_tag(name, arguments.days, arguments.renew, arguments.site)
        print(f"{name}: copy the folder {bundle} to the tag, then: dropanchor-tag publish --credentials {bundle.name}")
    print(_restart(folder.path))


def _revoke(folder: SecurityFolder, arguments: argparse.Namespace) -> None:
    for name in arguments.name:
        folder.revoke_tag(name, arguments.site)
        print(f"{name}: no longer admitted")
    print(_restart(folder.path))


def _list(folder: SecurityFolder, _arguments: argparse.Namespace) -> None:
    for name, tag in sorted(folder.table.tags.items()):
        state = "admitted" if tag.revoked is None else f"revoked {tag.revoked:%Y-%m-%d}"
        print(f"{name}\t{state}\tcertificate expires {tag.expires:%Y-%m-%d}\tserial {tag.serial}")


def _restart(folder: Path) -> str:
    return (
        f"{folder / ROUTER_FILE} is updated. Restart the router to apply it (or the service, if it runs the built-in "
        "router)."
    )
