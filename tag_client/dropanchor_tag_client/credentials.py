"""Read the folder that `dropanchor tag add` creates for a tag: its id, its endpoint and its certificate."""

import json
from pathlib import Path
from typing import NamedTuple

from dropanchor_tag_client.session import SessionSettings


class Credentials(NamedTuple):
    """Identity and session settings of one tag."""

    tag: str
    site: str
    session: SessionSettings


def read_credentials(folder: str | Path, connect: str | None = None) -> Credentials:
    """Return the credentials in a folder. Raises ValueError if the folder is not complete.

    connect: an endpoint that replaces the one in the folder.
    """
    path = Path(folder)
    try:
        metadata = json.loads((path / "tag.json").read_bytes())
        tag, site, endpoint = (str(metadata[name]) for name in ("tag", "site", "connect"))
    except OSError as error:
        raise ValueError(f"{path} holds no credentials of a tag: {error.strerror}: tag.json") from error
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{path / 'tag.json'} is damaged: run `dropanchor tag add --renew` for the tag") from error
    session = SessionSettings(
        connect=connect or endpoint, ca=path / "ca.pem", cert=path / "tag.pem", key=path / "tag.key"
    )
    return Credentials(tag, site, session)
