"""Refuse to listen beyond the loopback without credentials, unless the settings allow it."""

import ipaddress
import json
import socket
from collections.abc import Iterable, Iterator
from typing import Any

import zenoh

from dropanchor_service.security.credentials import certificate_of
from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.model import Settings, ZenohSettings
from dropanchor_service.settings.sources import SettingsError

_LOCAL_LINKS = ("unixsock-stream", "unixpipe", "serial", "vsock")
_ENCRYPTED_LINKS = ("tls", "quic")

_WHAT_TO_DO = """\
Either create credentials, and pass the folder to the router and to the service:
  dropanchor security init --security security --host NAME_OR_ADDRESS_OF_THIS_MACHINE
  and add: --security security
or, on a trusted network, allow connections without credentials:
  add: --insecure      (settings: insecure = true, environment: DROPANCHOR_INSECURE=true)"""


def refuse_exposure(settings: Settings, credentials: SecurityFolder | None) -> None:
    """Raise SettingsError, with advice, when other machines could connect without credentials."""
    if settings.insecure:
        return
    exposed = list(_exposed_zenoh(settings.zenoh, credentials))
    if not is_loopback(settings.http.host) and not _is_guarded(settings, credentials):
        exposed.insert(0, f"HTTP at {settings.http.host}")
    if exposed:
        listeners = " and ".join(exposed)
        raise SettingsError(f"{listeners} would be open to the network without credentials.\n{_WHAT_TO_DO}")


def _is_guarded(settings: Settings, credentials: SecurityFolder | None) -> bool:
    """Return whether REST authenticates its clients and encrypts the traffic."""
    authenticates = credentials is not None or settings.security.oidc is not None
    return authenticates and certificate_of(settings.http, credentials) is not None


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach the host.

    A name that cannot be resolved counts as loopback: nothing can listen there.
    """
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        pass
    try:
        found = socket.getaddrinfo(host, None)
    except (socket.gaierror, UnicodeError):
        return True
    return all(ipaddress.ip_address(str(address[0]).partition("%")[0]).is_loopback for *_, address in found)


def _exposed_zenoh(settings: ZenohSettings, credentials: SecurityFolder | None) -> Iterator[str]:
    if settings.config_file is not None:
        yield from _exposed_by_file(settings)
    elif not settings.connect and (credentials is None or "listen" in settings.model_fields_set):
        safe = () if credentials is None else _ENCRYPTED_LINKS  # without TLS nobody shows a certificate
        exposed = (endpoint for endpoint in settings.listen if not endpoint.startswith(safe))
        yield from (f"Zenoh at {endpoint}" for endpoint in exposed if _is_reachable(endpoint))


def _exposed_by_file(settings: ZenohSettings) -> Iterator[str]:
    """Yield the listeners of a Zenoh configuration file that require neither certificates nor passwords over TLS."""
    try:
        config = zenoh.Config.from_file(str(settings.config_file))
    except zenoh.ZError:
        return  # the error is reported when the session is opened
    mode = json.loads(config.get_json("mode")) or "peer"
    listen = json.loads(config.get_json("listen/endpoints")) if mode != "client" else []
    authenticates = _has(config, "transport/link/tls/enable_mtls") or _has(
        config, "transport/auth/usrpwd/dictionary_file"
    )
    for endpoint in _endpoints(listen.get(mode, []) if isinstance(listen, dict) else listen):
        if _is_reachable(endpoint) and not (authenticates and endpoint.startswith(_ENCRYPTED_LINKS)):
            yield f"Zenoh at {endpoint} (set in {settings.config_file})"


def _has(config: zenoh.Config, key: str) -> bool:
    return bool(json.loads(config.get_json(key)))


def _endpoints(listed: Any) -> Iterable[str]:
    return [listed] if isinstance(listed, str) else listed


def _is_reachable(endpoint: str) -> bool:
    protocol, _, address = endpoint.partition("/")
    host = address.partition("#")[0].partition("?")[0].rpartition(":")[0]
    return protocol not in _LOCAL_LINKS and not is_loopback(host.strip("[]"))
