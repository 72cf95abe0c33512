"""Answers to Zenoh queries: `…/tag/*/pose`, `…/tag/*/settings` and `…/anchor/*`, also with wildcards over many.

A queryable that raises leaves its client without any reply, so every unexpected error becomes an error reply.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from typing import Any, Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_schemas.times import ns_of_parameter
from dropanchor_service.answers.answers import Answer, Answers, to_json
from dropanchor_service.answers.of_sites import AnswersOfSites
from dropanchor_service.answers.pose_at_time import NoPoseThenError
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.runtime.may_serve import MayServe, always
from dropanchor_service.store.tags import Tag

MAX_TAGS_FROM_DISK = 100  # in one query

Reply = tuple[str, bytes]
"""Key and JSON."""


class QueryError(Exception):
    """A query cannot be answered; the message says why."""


class ZenohAnswers:
    """Answers queries while it is open, one after another, in a thread of Zenoh. While it may not, it says nothing."""

    def __init__(
        self,
        session: zenoh.Session,
        sites: AnswersOfSites,
        service_id: str,
        metrics: Metrics,
        may_answer: MayServe = always,
    ) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._sites = sites
        self._service_id = service_id
        self._metrics = metrics
        self._may_answer = may_answer
        self._declared: list[Any] = []

    def __enter__(self) -> Self:
        for key, find in zip(self._keys(), (self.poses, self.anchors, self.settings), strict=True):
            self._declared.append(self._session.declare_queryable(key, self._answering(find)))
        for answers in self._sites:
            alive = keys.service_alive_key(answers.site.site.id, self._service_id)
            self._declared.append(self._session.liveliness().declare_token(alive))
        return self

    def _keys(self) -> tuple[str, str, str]:
        """Return the key expressions of poses, anchors and settings."""
        if self._sites.only is None:
            bucket = self._sites.bucket
            return keys.all_sites("pose", bucket), keys.anchors_of_all_sites(bucket), keys.all_sites("settings", bucket)
        site = self._sites.only.site.site.id
        return keys.all_tags(site, "pose"), keys.all_anchors(site), keys.all_tags(site, "settings")

    def __exit__(self, *_: object) -> None:
        for declared in self._declared:
            declared.undeclare()

    def poses(self, key_expr: zenoh.KeyExpr, parameters: str) -> Iterator[Reply]:
        """Yield the poses of all tags that match, the latest ones or those at the time in `parameters`.

        Raises QueryError when the key names one tag and that tag has no such pose.
        """
        at_ns = _time_of(parameters)
        name = _single_tag(str(key_expr))
        for answers in self._sites.matching(str(key_expr)):
            site = answers.site.site.id
            of_site = _poses(answers, key_expr, at_ns) if name is None else [(name, _pose(answers, name, at_ns))]
            yield from ((keys.pose_key(site, tag), text) for tag, text in of_site)

    def anchors(self, key_expr: zenoh.KeyExpr, parameters: str) -> Iterator[Reply]:
        """Yield the anchors that match. Raises QueryError when the key names one anchor that its site lacks."""
        _refuse_parameters(parameters)
        for answers in self._sites.matching(str(key_expr)):
            site = answers.site.site
            found = [
                (key, to_json(anchor.model_dump() | {"site": site.model_dump(exclude={"anchors"})}))
                for key, anchor in ((keys.anchor_key(site.id, anchor.id), anchor) for anchor in site.anchors)
                if key_expr.includes(key)
            ]
            if not found and "*" not in str(key_expr):
                raise QueryError(f"anchor {str(key_expr).rpartition('/')[2]!r} is unknown")
            yield from found

    def settings(self, key_expr: zenoh.KeyExpr, parameters: str) -> Iterator[Reply]:
        """Yield what the programs of all tags that match should apply. A tag of which nothing is known is one."""
        _refuse_parameters(parameters)
        name = _single_tag(str(key_expr))
        for answers in self._sites.matching(str(key_expr)):
            names = list(answers.site.document.remote) if name is None else [name]
            for one in names:
                key = keys.settings_key(answers.site.site.id, one)
                if key_expr.includes(key):
                    yield key, to_json(answers.site.remote_settings(one).model_dump())

    def _answering(self, find: Callable[[zenoh.KeyExpr, str], Iterator[Reply]]) -> Callable[[zenoh.Query], None]:
        def answer(query: zenoh.Query) -> None:
            with query:
                if not self._may_answer():
                    return
                try:
                    for key, payload in find(query.key_expr, str(query.parameters)):
                        query.reply(key, payload, encoding=zenoh.Encoding.APPLICATION_JSON)
                except QueryError as error:
                    query.reply_err(to_json({"error": str(error)}), encoding=zenoh.Encoding.APPLICATION_JSON)
                except Exception as error:
                    self._metrics.faults["query"].inc()
                    self._log.exception("query", error)
                    query.reply_err(to_json({"error": "internal error"}), encoding=zenoh.Encoding.APPLICATION_JSON)

        return answer


def _poses(answers: Answers, key_expr: zenoh.KeyExpr, at_ns: int | None) -> Iterator[tuple[str, bytes]]:
    """Yield tag and pose of all tags of a site that match."""
    site = answers.site.site.id
    matching = [tag for tag in answers.tags.all() if key_expr.includes(keys.pose_key(site, tag.name))]
    if at_ns is None:
        yield from answers.pose_jsons(answers.rows(matching), answers.now_ns())
    else:
        yield from ((pose["tag"], to_json(pose)) for pose in _poses_at(answers, matching, at_ns))


def _pose(answers: Answers, name: str, at_ns: int | None) -> bytes:
    """Return the pose of a tag. Raises QueryError when it has none."""
    tag = answers.tags.find(name)
    try:
        pose = answers.pose_at(name, at_ns) if at_ns is not None else None if tag is None else answers.pose_of(tag)
    except NoPoseThenError as error:
        raise QueryError(f"tag {name!r}: {error}") from error
    if pose is None:
        raise QueryError(f"tag {name!r} is unknown" if tag is None else f"tag {name!r} has no pose yet")
    return to_json(pose)


def _poses_at(answers: Answers, tags: Sequence[Tag], at_ns: int) -> Iterator[Answer]:
    """Yield the poses at that time, of the tags that have one.

    The history on disk is read only for a few tags, because other queries wait meanwhile.
    """
    for tag in tags:
        with suppress(NoPoseThenError):
            pose = answers.pose_at(tag.name, at_ns, from_disk=len(tags) <= MAX_TAGS_FROM_DISK)
            if pose is not None:
                yield pose


def _single_tag(key: str) -> str | None:
    """Return the tag that the key names; None for wildcards. Raises QueryError when the key is malformed."""
    if "*" in key or "$" in key:
        return None
    try:
        return keys.tag_from_key(key)
    except keys.InvalidKeyError as error:
        raise QueryError(str(error)) from error


def _time_of(parameters: str) -> int | None:
    """Return the time in `at=<t_ns or ISO 8601>`; None without it. Raises QueryError for any other parameter."""
    times = [part for part in parameters.split(";") if part.startswith("at=")]
    _refuse_parameters(";".join(part for part in parameters.split(";") if part not in times))
    if not times:
        return None
    if len(times) > 1:
        raise QueryError("parameter 'at' takes one time")
    try:
        at_ns = ns_of_parameter(times[0].removeprefix("at="))
    except ValueError as error:
        raise QueryError(f"parameter 'at': {error}") from error
    if not 0 <= at_ns < 2**63:
        raise QueryError("parameter 'at': the time is out of range")
    return at_ns


def _refuse_parameters(parameters: str) -> None:
    """Raise QueryError for any parameter, since ignoring one would answer a different question."""
    unknown = [part.partition("=")[0] for part in parameters.split(";") if part and not part.startswith("_")]
    if unknown:
        raise QueryError(f"parameter {unknown[0]!r} is unknown")
