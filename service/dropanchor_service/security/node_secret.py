"""The secret that API nodes show to the services of a cluster."""

from pathlib import Path

from dropanchor_service.settings.sources import SettingsError

LEAST_BYTES = 16
MOST_BYTES = 1024


def node_secret_of(path: Path | None) -> bytes | None:
    """Return the secret in a file, without the white space around it; None without a file. Raises SettingsError."""
    if path is None:
        return None
    try:
        secret = path.read_bytes().strip()
    except OSError as error:
        raise SettingsError(f"cluster.node_secret: {path} cannot be read: {error.strerror}") from error
    if not LEAST_BYTES <= len(secret) <= MOST_BYTES or not secret.isascii() or b"\n" in secret:
        raise SettingsError(
            f"cluster.node_secret: {path} must hold one line of {LEAST_BYTES} to {MOST_BYTES} ASCII characters: make "
            f"it with `head -c 32 /dev/urandom | base64 > {path}`"
        )
    return secret
