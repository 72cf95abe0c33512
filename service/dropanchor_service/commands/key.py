"""`dropanchor key`: manage API keys."""

import argparse
import sys
from urllib.parse import quote, urlsplit

import segno

from dropanchor_service.commands.options import positive
from dropanchor_service.commands.security import add_folder_option, add_site_option
from dropanchor_service.phones.phyphox_experiment import link_of
from dropanchor_service.security.api_keys import ApiKeyError, ApiKeys
from dropanchor_service.security.folder import SecurityError, SecurityFolder
from dropanchor_service.security.identity import SCOPES, Scope

DESCRIPTION = """\
Manages the API keys of the REST interface and the page. A key is shown once and stored as a hash. A running service
applies changes within a second. Scopes: read allows poses, tags, metrics and the stream; write also allows settings of
tags and anchors; admin allows everything. A key with --tag sends the samples of that tag over HTTP and
does nothing else; it is for a phone.
"""
EPILOG = """\
examples:
  dropanchor key add dashboard --scope read
  dropanchor key add anna-phone --tag anna --url https://yard.example:8080
  dropanchor key add anna-phone --tag anna --url https://yard.example:8080 --phyphox
  dropanchor key add yard-manager --scope write --site annexe
  dropanchor key list
  dropanchor key revoke dashboard
  curl --cacert security/ca.pem -H "Authorization: Bearer $KEY" https://localhost:8080/api/v1/poses
"""
REFUSED = (SecurityError, ApiKeyError, OSError)


def add_arguments(parser: argparse.ArgumentParser) -> None:
    actions = parser.add_subparsers(dest="action", required=True, metavar="ACTION")
    add = actions.add_parser("add", help="create a key")
    add.add_argument("name", metavar="NAME", help="name of the user or program")
    allowed = add.add_mutually_exclusive_group()
    allowed.add_argument("--scope", choices=SCOPES, default="read", help="what the key allows (default: %(default)s)")
    allowed.add_argument("--tag", help="allow only to send the samples of this tag")
    add_site_option(add, "allow only this site (default: all); needed for --tag where the folder has several")
    add.add_argument("--url", metavar="URL", help="print the link that makes a phone this tag, and its QR code")
    add.add_argument(
        "--phyphox", action="store_true", help="with --url: print the code that the app phyphox scans instead"
    )
    add.add_argument("--days", type=positive, metavar="N", help="days until the key expires (default: never)")
    revoke = actions.add_parser("revoke", help="revoke a key")
    revoke.add_argument("name", metavar="NAME")
    listed = actions.add_parser("list", help="list the keys, without their secrets")
    for action in (add, revoke, listed):
        add_folder_option(action)


def run(arguments: argparse.Namespace) -> None:
    """Run the action. Raises REFUSED."""
    folder = SecurityFolder.open(arguments.security)
    _refuse_site(folder, arguments)
    keys = ApiKeys(folder.path)
    {"add": _add, "revoke": _revoke, "list": _list}[arguments.action](keys, arguments)


def _refuse_site(folder: SecurityFolder, arguments: argparse.Namespace) -> None:
    """Raise SecurityError where a key would be for a site that is not there, or for a tag of an unnamed one."""
    if arguments.action == "add" and (arguments.site is not None or arguments.tag is not None):
        folder.site_named(arguments.site)


def _add(keys: ApiKeys, arguments: argparse.Namespace) -> None:
    """Add a key. Only the key goes to standard output, so that a script can read it."""
    if arguments.url is not None:
        _refuse_url(arguments.url, arguments.tag)
    elif arguments.phyphox:
        raise ApiKeyError("--phyphox needs --url: the address at which the phone reaches the service")
    if arguments.tag is None:
        print(keys.add(arguments.name, Scope.named(arguments.scope), arguments.days, arguments.site))
    else:
        secret = keys.add_for_tag(arguments.name, arguments.tag, arguments.days, arguments.site)
        print(secret)
        if arguments.url is not None:
            _show_link(arguments.url, arguments.tag, secret, arguments.phyphox)
    sys.stderr.write("The key above is shown once. Send it as: Authorization: Bearer KEY\n")


def tag_page_link(url: str, tag: str, secret: str) -> str:
    """Return the link to the page of a tag. Browsers keep what follows the # to themselves, so no log has the key."""
    return f"{url.rstrip('/')}/tag/#tag={quote(tag, safe='')}&key={quote(secret, safe='')}"


def _refuse_url(url: str, tag: str | None) -> None:
    """Raise ApiKeyError where there is no link to show, before a key is made."""
    if tag is None:
        raise ApiKeyError("--url needs --tag: the link makes a phone that tag")
    parts = urlsplit(url)
    if parts.scheme not in ("http", "https") or not parts.netloc or parts.query or parts.fragment:
        raise ApiKeyError(f"--url {url}: give the address of the page, such as https://yard.example:8080")


def _show_link(url: str, tag: str, secret: str, phyphox: bool) -> None:
    """Print a QR code and its link. Whoever sees them can send samples of the tag."""
    path = f"{url.rstrip('/')}/api/v1/ingest/phyphox"
    link = link_of(path, tag, secret) if phyphox else tag_page_link(url, tag, secret)
    segno.make(link, error="l").terminal(out=sys.stderr, border=2, compact=True)
    if phyphox:
        sys.stderr.write(f"In phyphox, tap + and scan the code, or open on the phone: {link}\n")
        return
    sys.stderr.write(f"Scan the code with the phone, or open: {link}\n")
    if not link.startswith("https:"):
        sys.stderr.write("Phones give their motion to pages over https:// only.\n")


def _revoke(keys: ApiKeys, arguments: argparse.Namespace) -> None:
    keys.revoke(arguments.name)
    print(f"{arguments.name}: revoked")


def _list(keys: ApiKeys, _arguments: argparse.Namespace) -> None:
    for identifier, key in sorted(keys.all().items(), key=lambda entry: entry[1].name):
        expires = "never expires" if key.expires is None else f"expires {key.expires:%Y-%m-%d}"
        print(f"{key.name}\t{key.permission}\t{expires}\t{identifier}…\tmade {key.made:%Y-%m-%d}")
