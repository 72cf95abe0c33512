"""`dropanchor check`: check what a service needs at its start, without starting it."""

import argparse
import os
import socket
import ssl
import sys
import time
from collections.abc import Callable, Iterable, Iterator, Sequence
from urllib.parse import urlsplit

from dropanchor_service.api.http.server import ListenError, listen
from dropanchor_service.commands.options import add_service_options, settings_of
from dropanchor_service.persistence.site import open_basemap, open_database, open_sites
from dropanchor_service.runtime import logs
from dropanchor_service.runtime.recovery import Recovery
from dropanchor_service.security.credentials import certificate_of, credentials_of, keys_and_tokens_of
from dropanchor_service.settings.many_sites import refuse_too_many_sites
from dropanchor_service.settings.model import Settings
from dropanchor_service.settings.served import served_settings
from dropanchor_service.settings.sources import SettingsError
from dropanchor_service.zenoh_io.exposure import refuse_exposure
from dropanchor_service.zenoh_io.session import listening_at
from dropanchor_tag_client.folder_lock import FolderLock

DESCRIPTION = """\
Checks what `dropanchor serve` with the same options needs: that the settings are valid, the credentials and
certificates can be read, the data folder can be written and no other process has it, and the ports are free. It starts
nothing and changes nothing. Exit code: 0 good, 1 with a sentence for each fault.
"""
EPILOG = """\
examples:
  dropanchor check --config yard.toml
  dropanchor check --config yard.toml --security security --running && systemctl restart dropanchor
"""
EXIT_FAULTS = 1
ROUTER_S = 2.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--running", action="store_true", help="leave out what a running service has itself: its ports and data folder"
    )
    add_service_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Print what is wrong. Return 0 if nothing is, else 1."""
    logs.configure(arguments.log_level)
    try:
        settings = served_settings(settings_of(arguments))
        refuse_too_many_sites(settings)
        faults = list(dict.fromkeys(_faults(settings, arguments.running)))
    except SettingsError as error:
        faults = [str(error)]
    sys.stderr.writelines(f"dropanchor check: {fault}\n" for fault in faults)
    if not faults:
        print("settings, credentials, folders and ports are good")
    return EXIT_FAULTS if faults else 0


def _of_credentials(settings: Settings) -> Iterator[str]:
    credentials = credentials_of(settings)
    keys_and_tokens_of(settings)
    refuse_exposure(settings, credentials)
    if (certificate := certificate_of(settings.http, credentials)) is None:
        return
    try:
        context = ssl.create_default_context(ssl.Purpose.CLIENT_AUTH)
        context.load_cert_chain(certificate.certificate, certificate.key)
    except OSError as error:  # an SSLError is one, too
        yield f"{certificate.certificate} with {certificate.key} cannot be used: {error.strerror or error}"


def _of_router(settings: Settings) -> Iterator[str]:
    for host, port in _sockets(settings.zenoh.connect):
        try:
            socket.create_connection((host, port), ROUTER_S).close()
        except OSError as error:
            yield f"zenoh.connect: no router answers at {host} port {port} ({error}): check the address, and start it"


def _of_basemap(settings: Settings) -> Sequence[str]:
    without_data = settings.model_copy(update={"data_dir": None})
    basemap = open_basemap(settings, [site.store for site in open_sites(without_data, Recovery())])
    if basemap is not None:
        basemap.file.close()
    return ()


def _of_history(settings: Settings) -> Sequence[str]:
    open_database(settings, time.time_ns)  # it connects to nothing yet
    return ()


def _of_data_dir(settings: Settings) -> Iterator[str]:
    folder = settings.data_dir
    if folder is None:
        return
    place = next(path for path in (folder.absolute(), *folder.absolute().parents) if path.exists())
    if not place.is_dir():
        yield f"data_dir: {place} is no folder: choose another one"
    elif not os.access(place, os.W_OK | os.X_OK):
        yield f"data_dir: this user cannot write into {place}"


def _of_owner(settings: Settings) -> Iterator[str]:
    folder = settings.data_dir
    if folder is not None and (owner := FolderLock.holder(folder)) is not None:
        yield f"data_dir: {folder} is in use by {owner}: stop it, or give this process a folder of its own"


def _of_ports(settings: Settings) -> Iterator[str]:
    listens = settings.zenoh.config_file is None and not settings.zenoh.connect
    own = _sockets(listening_at(settings.zenoh, credentials_of(settings))) if listens else ()
    for host, port in ((settings.http.host, settings.http.port), *own):
        try:
            listen(host, port, connections=1).close()
        except ListenError as error:
            yield str(error)


def _sockets(endpoints: Sequence[str]) -> Iterator[tuple[str, int]]:
    """Yield host and port of the endpoints of Zenoh that are sockets of TCP."""
    for endpoint in endpoints:
        if endpoint.startswith(("tcp/", "tls/")):
            parts = urlsplit(endpoint.replace("/", "://", 1))
            yield parts.hostname or "", parts.port or 0


_CHECKS = (_of_credentials, _of_router, _of_basemap, _of_history, _of_data_dir)
_OF_THE_FREE = (_of_owner, _of_ports)


def _faults(settings: Settings, runs: bool) -> Iterator[str]:
    """Yield a sentence for each fault. runs: the service itself has the folder and the ports."""
    checks: Sequence[Callable[[Settings], Iterable[str]]] = _CHECKS if runs else (*_CHECKS, *_OF_THE_FREE)
    for check in checks:
        try:
            yield from check(settings)
        except SettingsError as error:
            yield str(error)
