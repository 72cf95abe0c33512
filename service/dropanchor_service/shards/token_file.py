"""The token that every process of Ray shows to every other."""

import secrets
import stat
from pathlib import Path


class TokenError(ValueError):
    """The token cannot be used; the message says why."""


def made_or_read(path: Path, may_make: bool) -> Path:
    """Return the path of the token, as an absolute one. may_make: make it if it is not there. Raises TokenError."""
    try:
        if may_make and not path.exists():
            path.parent.mkdir(parents=True, exist_ok=True)
            path.touch(mode=0o600)
            path.write_text(f"{secrets.token_hex(32)}\n")
        mode, text = stat.S_IMODE(path.stat().st_mode), path.read_text().strip()
    except FileNotFoundError as error:
        raise TokenError(f"there is no token at {path}: copy the one of the head, with mode 600") from error
    except OSError as error:
        raise TokenError(f"the token at {path} cannot be read or made: {error.strerror}") from error
    if mode & 0o077:
        raise TokenError(f"others may read the token at {path}: chmod 600 {path}")
    if len(text) < 32:
        raise TokenError(f"the token at {path} is too short: copy the one of the head")
    return path.absolute()
