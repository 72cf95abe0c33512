"""The folder that `dropanchor tag add` creates for a tag: its id, its endpoint and its certificate."""

import json
from pathlib import Path
from typing import NamedTuple

import zenoh

from dropanchor_tag_client.session import SessionSettings, SharedSession


class OtherTagError(ValueError):
    """The credentials are not of this tag."""


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
        tag, site, endpoint = _metadata(path)
    except OSError as error:
        raise ValueError(f"{path} holds no credentials of a tag: {error.strerror}: tag.json") from error
    session = SessionSettings(
        connect=connect or endpoint, ca=path / "ca.pem", cert=path / "tag.pem", key=path / "tag.key"
    )
    return Credentials(tag, site, session)


def connection_of(
    connect: str | SessionSettings | SharedSession | zenoh.Session, site: str, tag: str
) -> SessionSettings | zenoh.Session:
    """Return what a tag connects with. Raises OtherTagError if the certificate is another tag's.

    A router with access control would drop every message of the tag in silence. Whose a certificate is says the
    `tag.json` beside it; of one without, only its router knows.
    """
    if isinstance(connect, zenoh.Session):
        return connect
    if isinstance(connect, SharedSession):
        _refuse_other_tag(connect.settings, site, tag)
        return connect.session
    settings = SessionSettings(connect=connect) if isinstance(connect, str) else connect
    _refuse_other_tag(settings, site, tag)
    return settings


def _refuse_other_tag(session: SessionSettings, site: str, tag: str) -> None:
    if session.cert is None:
        return
    folder = Path(session.cert).parent
    try:
        of_tag, of_site, _ = _metadata(folder)
    except OSError:
        return
    if (of_tag, of_site) != (tag, site):
        raise OtherTagError(
            f"the credentials in {folder} are of tag {of_tag!r} in site {of_site!r}; the router would drop what they "
            f"send for tag {tag!r} in site {site!r}: `dropanchor tag add` makes its own"
        )


def _metadata(folder: Path) -> tuple[str, str, str]:
    """Return tag, site and endpoint in a folder. Raises OSError without the file, and ValueError if it is damaged."""
    file = folder / "tag.json"
    try:
        metadata = json.loads(file.read_bytes())
        return str(metadata["tag"]), str(metadata["site"]), str(metadata["connect"])
    except (ValueError, TypeError, KeyError) as error:
        raise ValueError(f"{file} is damaged: run `dropanchor tag add --renew` for the tag") from error
