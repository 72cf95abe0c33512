"""The folder that `dropanchor tag add` makes for a tag: who it is, where it connects, and its certificate."""

import json
from dataclasses import dataclass
from pathlib import Path

from dropanchor_tag_client.session import SessionSettings


@dataclass(frozen=True, slots=True)
class Credentials:
    """Of one tag."""

    tag: str
    site: str
    session: SessionSettings


def read_credentials(folder: str | Path, connect: str | None = None) -> Credentials:
    """connect: another endpoint than the one in the folder. Raises ValueError when the folder is not complete."""
    path = Path(folder)
    try:
        about = json.loads((path / "tag.json").read_bytes())
        tag, site, endpoint = (str(about[name]) for name in ("tag", "site", "connect"))
    except OSError as error:
        raise ValueError(f"{path} holds no credentials of a tag: {error.strerror}: tag.json") from error
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path / 'tag.json'} is damaged") from error
    session = SessionSettings(
        connect=connect or endpoint, ca=path / "ca.pem", cert=path / "tag.pem", key=path / "tag.key"
    )
    return Credentials(tag, site, session)
