"""The TLS certificate of the HTTP server."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Certificate:
    """A certificate chain and its private key, as PEM files."""

    certificate: Path
    key: Path
