"""The names by which clients may call this service, as far as it knows them by itself."""

import ipaddress
import socket
from collections.abc import Iterator

from cryptography import x509

from dropanchor_service.security.folder import SecurityFolder
from dropanchor_service.settings.http import HttpSettings

LOOPBACK_NAME = "localhost"


def own_hosts(http: HttpSettings, credentials: SecurityFolder | None) -> list[str]:
    """Return the names of the settings and the certificates, and beyond the loopback that of the machine."""
    return [
        LOOPBACK_NAME,
        *http.allowed_hosts,
        *([] if credentials is None else credentials.table.hosts),
        *_in_certificate(http),
        *_of_machine(http.host),
    ]


def _in_certificate(http: HttpSettings) -> list[str]:
    """Return the names in the certificate of the settings; the server says what is wrong with one."""
    try:
        if http.certificate is None:
            return []
        certificate = x509.load_pem_x509_certificate(http.certificate.read_bytes())
        names = certificate.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    except (OSError, ValueError, x509.ExtensionNotFound):
        return []
    return names.get_values_for_type(x509.DNSName)


def _of_machine(host: str) -> Iterator[str]:
    """Yield the names of this machine when others reach it, and the host itself."""
    try:
        if ipaddress.ip_address(host).is_loopback:
            return
    except ValueError:
        yield host
    if host != LOOPBACK_NAME:
        name = socket.gethostname()
        short = name.partition(".")[0]
        yield from (name, short, f"{short}.local")
