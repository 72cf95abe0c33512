"""Zenoh key expressions, defined in one place. This module needs only the standard library, because tags import it."""

from urllib.parse import quote, unquote

from dropanchor_schemas.sentences import say

PREFIX = "dropanchor/@v1"
MAX_ID_LENGTH = 64
NOT_IDS = (".", "..")


class InvalidKeyError(ValueError):
    """An identifier or key that does not follow the contract."""


def chunk_from_id(identifier: str) -> str:
    """Return the key chunk of a site, tag or anchor id.

    `[A-Za-z0-9._-]` stand for themselves; all other characters are percent-escaped as UTF-8. Raises InvalidKeyError
    if the id is empty, longer than 64 characters, `.` or `..`, or has characters that are not printable.
    """
    if not 0 < len(identifier) <= MAX_ID_LENGTH:
        raise InvalidKeyError(
            say(
                "id_length", "an id has 1 to {most} characters, this one has {n}", most=MAX_ID_LENGTH, n=len(identifier)
            )
        )
    if not identifier.isprintable():
        raise InvalidKeyError(say("id_printable", "an id holds printable characters only"))
    if identifier in NOT_IDS:
        raise InvalidKeyError(
            say("id_dots", "{id} cannot be an id: in paths and addresses it stands for a folder", id=repr(identifier))
        )
    return quote(identifier, safe="").replace("~", "%7E")


def checked_id(identifier: str) -> str:
    """Return the id. Raises InvalidKeyError if it is none."""
    chunk_from_id(identifier)
    return identifier


def refuse_pattern(identifier: str) -> None:
    """Raise InvalidKeyError if the id looks like a pattern for several tags, which settings do not support."""
    if "*" in identifier:
        raise InvalidKeyError(
            say(
                "id_pattern",
                "{id} would be the id of one tag, not a pattern: there are no settings for all tags; give "
                "each tag its own",
                id=repr(identifier),
            )
        )


def id_from_chunk(chunk: str) -> str:
    """Return the id of a key chunk. Raises InvalidKeyError unless `chunk_from_id` gives this chunk back."""
    try:
        identifier = unquote(chunk, errors="strict")
    except UnicodeDecodeError as error:
        raise InvalidKeyError(say("key_escapes", "{part} is not percent-escaped UTF-8", part=repr(chunk))) from error
    if chunk_from_id(identifier) != chunk:
        raise InvalidKeyError(
            say(
                "key_form",
                "{part} is not in its one escaped form, {right}",
                part=repr(chunk),
                right=repr(chunk_from_id(identifier)),
            )
        )
    return identifier


def samples_key(site: str, tag: str) -> str:
    return f"{_tag_prefix(site, tag)}/samples"


def tag_alive_key(site: str, tag: str) -> str:
    return f"{_tag_prefix(site, tag)}/alive"


def health_key(site: str, tag: str) -> str:
    return f"{_tag_prefix(site, tag)}/health"


def settings_key(site: str, tag: str) -> str:
    return f"{_tag_prefix(site, tag)}/settings"


def pose_key(site: str, tag: str) -> str:
    return f"{_tag_prefix(site, tag)}/pose"


def event_key(site: str, tag: str) -> str:
    return f"{_tag_prefix(site, tag)}/event"


def poses_key(site: str) -> str:
    return f"{_site_prefix(site)}/poses"


def anchor_key(site: str, anchor: str) -> str:
    return f"{_site_prefix(site)}/anchor/{chunk_from_id(anchor)}"


def service_alive_key(site: str, service: str) -> str:
    return f"{_site_prefix(site)}/service/{chunk_from_id(service)}/alive"


def owner_key(bucket: str, epoch: int) -> str:
    """Return the key of the liveliness token of the process that owns a bucket of sites. No site can be `@owner`."""
    return f"{_owner_prefix(bucket)}/{epoch}"


def all_owners(bucket: str) -> str:
    """Return the key expression of the tokens of all owners of a bucket, of whatever epoch."""
    return f"{_owner_prefix(bucket)}/*"


def owners_of_all_buckets() -> str:
    return f"{PREFIX}/@owner/**"


def epoch_from_key(key: str) -> int | None:
    """Return the epoch in the key of an owner, None if the key has another form."""
    epoch = key.rpartition("/")[2]
    return int(epoch) if epoch.isascii() and epoch.isdigit() else None


def all_tags(site: str, leaf: str) -> str:
    """Return the key expression of `leaf` (such as "samples" or "pose") of every tag of the site."""
    return f"{_site_prefix(site)}/tag/*/{leaf}"


def all_sites(leaf: str, bucket: str | None = None) -> str:
    """Return the key expression of `leaf` of every tag of every site, or of those whose ids begin with a bucket."""
    return f"{PREFIX}/{_sites_in(bucket)}/tag/*/{leaf}"


def anchors_of_all_sites(bucket: str | None = None) -> str:
    return f"{PREFIX}/{_sites_in(bucket)}/anchor/*"


def poses_of_all_sites(bucket: str | None = None) -> str:
    return f"{PREFIX}/{_sites_in(bucket)}/poses"


def services_of_all_sites() -> str:
    return f"{PREFIX}/*/service/*/alive"


def everything_of_all_sites() -> str:
    """Return the key expression of every key of every site."""
    return f"{PREFIX}/*/**"


def all_anchors(site: str) -> str:
    return f"{_site_prefix(site)}/anchor/*"


def all_services_alive(site: str) -> str:
    return f"{_site_prefix(site)}/service/*/alive"


def everything(site: str) -> str:
    """Return the key expression of all keys of the site, except verbatim chunks such as Zenoh's own `@adv`."""
    return f"{_site_prefix(site)}/**"


def tag_from_key(key: str) -> str:
    """Return the tag id of a `…/tag/<tag>/<leaf>` key. Raises InvalidKeyError if the key has another form."""
    return id_from_chunk(_chunks(key)[4])


def site_and_tag_from_key(key: str) -> tuple[str, str]:
    """Return the site id and the tag id of such a key. Raises InvalidKeyError if the key has another form."""
    chunks = _chunks(key)
    return id_from_chunk(chunks[2]), id_from_chunk(chunks[4])


def _chunks(key: str) -> list[str]:
    """Return the chunks of a `…/tag/<tag>/<leaf>` key. Raises InvalidKeyError if the key has another form."""
    chunks = key.split("/")
    if len(chunks) != 6 or "/".join(chunks[:2]) != PREFIX or chunks[3] != "tag":
        raise InvalidKeyError(
            say("key_shape", "{key} is not {prefix}/<site>/tag/<tag>/<leaf>", key=repr(key), prefix=PREFIX)
        )
    return chunks


def _owner_prefix(bucket: str) -> str:
    return f"{PREFIX}/@owner/{chunk_from_id(bucket)}"


def _sites_in(bucket: str | None) -> str:
    """Return the chunk that matches the sites of a bucket, such as `017.yard` of `017`; without one, all sites."""
    return "*" if bucket is None else f"{chunk_from_id(bucket)}.$*"


def _site_prefix(site: str) -> str:
    return f"{PREFIX}/{chunk_from_id(site)}"


def _tag_prefix(site: str, tag: str) -> str:
    return f"{_site_prefix(site)}/tag/{chunk_from_id(tag)}"
