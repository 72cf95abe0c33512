"""Check with schemathesis that an interface follows its OpenAPI document, for valid and invalid requests."""

import os
from collections.abc import Iterator
from typing import Any

import schemathesis
from fastapi import FastAPI
from hypothesis import HealthCheck, given, seed, settings
from hypothesis.errors import Unsatisfiable
from schemathesis.checks import load_all_checks
from schemathesis.core.result import Ok
from schemathesis.schemas import APIOperation

Operation = APIOperation[Any, Any, Any, Any]

EXAMPLES = int(os.environ.get("DROPANCHOR_CONTRACT_EXAMPLES", "10"))
"""Valid requests per operation, and as many invalid ones. The seed is fixed, so that every run sends the same."""

ANSWER_S = 120.0  # at most: some operations start a process, and the machine may be busy


def operations_of(app: FastAPI, path: str) -> Iterator[Operation]:
    """Yield the operations of the document at this path."""
    load_all_checks()
    for found in schemathesis.openapi.from_asgi(path, app).get_all_operations():
        assert isinstance(found, Ok)
        yield found.ok()


def assert_follows_the_document(operation: Operation, excluded: list[Any]) -> None:
    """Send valid and invalid requests, and check the responses. excluded: checks that do not apply."""
    assert sum(_asked(operation, mode, excluded) for mode in schemathesis.GenerationMode) > 0


def _asked(operation: Operation, mode: schemathesis.GenerationMode, excluded: list[Any]) -> int:
    """Send requests of this kind and return how many. An operation without input has no invalid requests."""
    count = 0

    @seed(20)
    @settings(max_examples=EXAMPLES, deadline=None, database=None, suppress_health_check=list(HealthCheck))
    @given(case=operation.as_strategy(generation_mode=mode))
    def ask(case: schemathesis.Case[Any]) -> None:
        nonlocal count
        count += 1
        case.call_and_validate(excluded_checks=excluded, timeout=ANSWER_S)

    try:
        ask()
    except Unsatisfiable:
        assert mode is schemathesis.GenerationMode.NEGATIVE
    return count
