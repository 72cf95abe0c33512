"""Check with schemathesis that an interface follows its OpenAPI document, for valid and invalid requests."""

import itertools
import os
from collections.abc import Iterable, Iterator
from typing import Any

import schemathesis
from fastapi import FastAPI
from hypothesis import HealthCheck, given, seed, settings
from hypothesis.errors import Unsatisfiable
from schemathesis.checks import load_all_checks
from schemathesis.core.result import Ok
from schemathesis.schemas import APIOperation

Operation = APIOperation[Any, Any, Any, Any]

EXAMPLES = int(os.environ.get("DROPANCHOR_CONTRACT_EXAMPLES", "6"))
"""Valid requests per operation, and as many invalid ones. The seed is fixed, so that every run sends the same."""

ANSWER_S = 120.0  # at most: some operations start a process, and the machine may be busy


def operations_of(app: FastAPI, path: str, names: Iterable[str], over_http: bool = False) -> dict[str, Operation]:
    """Return the operations of the document at this path, by their ids. over_http: to send them to an address.

    names: all of their ids, which the tests have from a document that takes no time to make.
    """
    load_all_checks()
    found = schemathesis.openapi.from_dict(app.openapi()) if over_http else schemathesis.openapi.from_asgi(path, app)
    operations = [each.ok() for each in found.get_all_operations() if isinstance(each, Ok)]
    by_id = {operation.definition.raw["operationId"]: operation for operation in operations}
    assert by_id.keys() == set(names)
    return by_id


def assert_follows_the_document(
    operation: Operation, excluded: list[Any], examples: int = EXAMPLES, places: Iterable[tuple[str, str]] = ()
) -> None:
    """Send valid and invalid requests, and check the responses. excluded: checks that do not apply.

    places: addresses to send them to, in turns, and the site that a valid request is about.
    """
    in_turns = itertools.cycle(places)
    assert sum(_asked(operation, mode, excluded, examples, in_turns) for mode in schemathesis.GenerationMode) > 0


def _asked(
    operation: Operation,
    mode: schemathesis.GenerationMode,
    excluded: list[Any],
    examples: int,
    places: Iterator[tuple[str, str]],
) -> int:
    """Send requests of this kind and return how many. An operation without input has no invalid requests."""
    count = 0

    @seed(20)
    @settings(max_examples=examples, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(case=operation.as_strategy(generation_mode=mode))
    def ask(case: schemathesis.Case[Any]) -> None:
        nonlocal count
        count += 1
        address, site = next(places, (None, None))
        if site and mode is schemathesis.GenerationMode.POSITIVE:
            case.path_parameters["site"] = site
        case.call_and_validate(base_url=address, excluded_checks=excluded, timeout=ANSWER_S)

    try:
        ask()
    except Unsatisfiable:
        assert mode is schemathesis.GenerationMode.NEGATIVE
    return count
