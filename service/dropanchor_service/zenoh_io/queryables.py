"""Answers to Zenoh queries: `…/tag/*/pose` and `…/anchor/*`, also with wildcards over many.

A queryable that raises leaves the asker without reply or error, so everything unforeseen is answered as an error.
"""

import logging
from collections.abc import Callable, Iterator, Sequence
from contextlib import suppress
from types import TracebackType
from typing import Any, Self

import zenoh

from dropanchor_schemas import keys
from dropanchor_service.answers.answers import Answer, Answers, to_json
from dropanchor_service.answers.pose_at_time import NoPoseThenError
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store.tags import Tag

FROM_DISK = 100  # tags of one query

Reply = tuple[str, bytes]
"""Key and JSON."""


class QueryError(Exception):
    """A query that has no answer; the message says why."""


class ZenohAnswers:
    """Answers while it is open. Queries are answered one after another in a thread of Zenoh's own."""

    def __init__(self, session: zenoh.Session, answers: Answers, service_id: str, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._session = session
        self._answers = answers
        self._site = answers.site.site.id
        self._service_id = service_id
        self._metrics = metrics
        self._declared: list[Any] = []

    def __enter__(self) -> Self:
        for key, find in (
            (keys.all_tags(self._site, "pose"), self.poses),
            (keys.all_anchors(self._site), self.anchors),
        ):
            self._declared.append(self._session.declare_queryable(key, self._answering(find)))
        alive = keys.service_alive_key(self._site, self._service_id)
        self._declared.append(self._session.liveliness().declare_token(alive))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        for declared in self._declared:
            declared.undeclare()

    def poses(self, asked: zenoh.KeyExpr, parameters: str) -> Iterator[Reply]:
        """Raises QueryError when one tag is asked for and has no pose, at that time if one is given."""
        at_ns = _time_of(parameters)
        name = _one_tag(str(asked))
        tags = self._answers.tags
        if name is not None:
            tag = tags.find(name)
            pose = self._pose(name, at_ns)
            if pose is None:
                raise QueryError(f"no tag {name!r} is known" if tag is None else f"tag {name!r} has no pose yet")
            yield keys.pose_key(self._site, name), to_json(pose)
            return
        wanted = [tag for tag in tags.all() if asked.includes(keys.pose_key(self._site, tag.name))]
        if at_ns is None:
            found = self._answers.pose_jsons(self._answers.rows(wanted), self._answers.now_ns())
        else:
            found = ((pose["tag"], to_json(pose)) for pose in self._poses_at(wanted, at_ns))
        yield from ((keys.pose_key(self._site, of), text) for of, text in found)

    def _pose(self, name: str, at_ns: int | None) -> Answer | None:
        try:
            if at_ns is not None:
                return self._answers.pose_at(name, at_ns)
        except NoPoseThenError as error:
            raise QueryError(f"tag {name!r}: {error}") from error
        tag = self._answers.tags.find(name)
        return None if tag is None else self._answers.pose_of(tag)

    def _poses_at(self, tags: Sequence[Tag], at_ns: int) -> Iterator[Answer]:
        """Of those tags that have a pose for that time; the history on disk is asked for a few tags only, because other
        queries wait meanwhile."""
        for tag in tags:
            with suppress(NoPoseThenError):
                pose = self._answers.pose_at(tag.name, at_ns, from_disk=len(tags) <= FROM_DISK)
                if pose is not None:
                    yield pose

    def anchors(self, asked: zenoh.KeyExpr, parameters: str) -> Iterator[Reply]:
        """Raises QueryError when one anchor is asked for and is not there."""
        _refuse(parameters)
        site = self._answers.site.site
        found = [
            (key, to_json(anchor.model_dump() | {"site": site.model_dump(exclude={"anchors"})}))
            for key, anchor in ((keys.anchor_key(site.id, anchor.id), anchor) for anchor in site.anchors)
            if asked.includes(key)
        ]
        if not found and "*" not in str(asked):
            raise QueryError(f"no anchor {str(asked).rpartition('/')[2]!r} is known")
        yield from found

    def _answering(self, find: Callable[[zenoh.KeyExpr, str], Iterator[Reply]]) -> Callable[[zenoh.Query], None]:
        def answer(query: zenoh.Query) -> None:
            with query:
                try:
                    for key, payload in find(query.key_expr, str(query.parameters)):
                        query.reply(key, payload, encoding=zenoh.Encoding.APPLICATION_JSON)
                except QueryError as error:
                    query.reply_err(to_json({"error": str(error)}), encoding=zenoh.Encoding.APPLICATION_JSON)
                except Exception as error:
                    self._metrics.faults.labels("query").inc()
                    self._log.exception("query", error)
                    query.reply_err(to_json({"error": "internal error"}), encoding=zenoh.Encoding.APPLICATION_JSON)

        return answer


def _one_tag(key: str) -> str | None:
    """The tag that a key without wildcards names. Raises QueryError when it does not follow the contract."""
    if "*" in key or "$" in key:
        return None
    try:
        return keys.tag_from_key(key)
    except keys.InvalidKeyError as error:
        raise QueryError(str(error)) from error


def _time_of(parameters: str) -> int | None:
    """The time in `at=<t_ns>`, None without it. Raises QueryError for anything else."""
    given = [part for part in parameters.split(";") if part.startswith("at=")]
    _refuse(";".join(part for part in parameters.split(";") if part not in given))
    if not given:
        return None
    digits = given[0].removeprefix("at=")
    if len(given) > 1 or not (digits.isascii() and digits.isdigit()) or int(digits) >= 2**63:
        raise QueryError("parameter 'at' takes one time, UTC in ns")
    return int(digits)


def _refuse(parameters: str) -> None:
    """Parameters that are not understood must not be ignored: the answer would be to another question."""
    unknown = [part.partition("=")[0] for part in parameters.split(";") if part and not part.startswith("_")]
    if unknown:
        raise QueryError(f"parameter {unknown[0]!r} is not known")
