"""The routes for webhooks: who gets which events, a test, and what could not be delivered."""

from typing import Annotated

import orjson
from fastapi import APIRouter, Body
from starlette.responses import Response

from dropanchor_schemas.webhooks import (
    DeadLetterList,
    Retried,
    Webhook,
    WebhookList,
    WebhookStatus,
    WebhookTest,
)
from dropanchor_service.api.http.errors import Kind, ProblemError, problems
from dropanchor_service.api.http.etags import Conditions
from dropanchor_service.api.routes import event_examples as examples
from dropanchor_service.api.routes.event_parts import EventParts
from dropanchor_service.api.routes.events import reading
from dropanchor_service.api.routes.items import CHANGE_KINDS, WebhookId, delete, found, item_response, put
from dropanchor_service.api.routes.parameters import NO_QUERY, example_response, json_response
from dropanchor_service.events.drafts import webhook_test
from dropanchor_service.events.store import cloud_event
from dropanchor_service.webhooks.addresses import UrlError, allowed, checked_url, resolved
from dropanchor_service.webhooks.sender import Verdict
from dropanchor_service.webhooks.signature import SecretError, key_of

_READ = (Kind.INVALID_REQUEST, Kind.EVENTS_UNREADABLE)
_ONE = (Kind.UNKNOWN_WEBHOOK, *_READ)


def webhooks_router(parts: EventParts) -> APIRouter:
    router = APIRouter(tags=["webhooks"], dependencies=[NO_QUERY])
    _add_read_routes(router, parts)
    _add_change_routes(router, parts)
    _add_delivery_routes(router, parts)
    return router


def _add_read_routes(router: APIRouter, parts: EventParts) -> None:
    @router.get(
        "/webhooks",
        operation_id="list_webhooks",
        summary="List the webhooks and the state of their queues",
        response_model=WebhookList,
        responses=example_response({"webhooks": [examples.WEBHOOK_STATUS]}) | problems(*_READ),
    )
    def list_webhooks() -> Response:
        statuses = [_status(parts, webhook) for webhook in parts.webhooks.all.values()]
        return json_response({"webhooks": [status.model_dump(mode="json") for status in statuses]})

    @router.get(
        "/webhooks/{webhook}",
        operation_id="get_webhook",
        summary="Get a webhook and the state of its queue",
        response_model=WebhookStatus,
        responses=example_response(examples.WEBHOOK_STATUS) | problems(*_ONE),
    )
    def get_webhook(webhook: WebhookId) -> Response:
        return _response(parts, found(parts.webhooks, webhook, Kind.UNKNOWN_WEBHOOK))


def _add_change_routes(router: APIRouter, parts: EventParts) -> None:
    @router.put(
        "/webhooks/{webhook}",
        operation_id="put_webhook",
        summary="Create or replace a webhook",
        description="It gets the events from now on. A receiver inside needs `allow_networks` in the settings.",
        response_model=WebhookStatus,
        responses=example_response(examples.WEBHOOK_STATUS) | problems(Kind.WEBHOOK_REFUSED, *CHANGE_KINDS, *_READ),
    )
    def put_webhook(
        webhook: WebhookId, body: Annotated[Webhook, Body(examples=[examples.WEBHOOK])], allows: Conditions
    ) -> Response:
        usable = _usable(parts, body)
        put(parts.webhooks, webhook, body.id, usable, allows)
        return _response(parts, usable)

    @router.delete(
        "/webhooks/{webhook}",
        operation_id="delete_webhook",
        summary="Delete a webhook and its queue",
        status_code=204,
        responses=problems(Kind.CHANGED_MEANWHILE, Kind.NOT_SAVED, *_ONE),
    )
    def delete_webhook(webhook: WebhookId, allows: Conditions) -> Response:
        response = delete(parts.webhooks, webhook, allows, Kind.UNKNOWN_WEBHOOK)
        with reading():
            parts.deliveries.drop(webhook)
        return response


def _add_delivery_routes(router: APIRouter, parts: EventParts) -> None:
    @router.post(
        "/webhooks/{webhook}/test",
        operation_id="test_webhook",
        summary="Send a test event to a webhook now",
        response_model=WebhookTest,
        responses=example_response(examples.WEBHOOK_TEST) | problems(*_ONE),
    )
    async def test_webhook(webhook: WebhookId) -> Response:
        known = found(parts.webhooks, webhook, Kind.UNKNOWN_WEBHOOK)
        body = cloud_event(webhook_test(webhook), 0, parts.store.site)
        async with parts.sender.client() as client:
            outcome = await parts.sender.send(client, known, body)
        return json_response({"delivered": outcome.verdict is Verdict.ACCEPTED, "detail": outcome.detail})

    @router.get(
        "/webhooks/{webhook}/dead-letters",
        operation_id="list_dead_letters",
        summary="List the events whose delivery was given up",
        response_model=DeadLetterList,
        responses=example_response(examples.DEAD_LETTERS) | problems(*_ONE),
    )
    def list_dead_letters(webhook: WebhookId) -> Response:
        found(parts.webhooks, webhook, Kind.UNKNOWN_WEBHOOK)
        with reading():
            dead = parts.deliveries.dead(webhook)
        letters = [{"event": orjson.Fragment(body), "reason": reason} for body, reason in dead]
        return json_response({"dead_letters": letters})

    @router.post(
        "/webhooks/{webhook}/dead-letters/retry",
        operation_id="retry_dead_letters",
        summary="Put the dead letters of a webhook back into its queue",
        response_model=Retried,
        responses=example_response({"retried": 1}) | problems(*_ONE),
    )
    def retry_dead_letters(webhook: WebhookId) -> Response:
        found(parts.webhooks, webhook, Kind.UNKNOWN_WEBHOOK)
        with reading():
            return json_response({"retried": parts.deliveries.retry(webhook)})


def _usable(parts: EventParts, webhook: Webhook) -> Webhook:
    """Return the webhook with its secret. Raises ProblemError when nothing could be delivered to it."""
    present = parts.webhooks.all.get(webhook.id)
    secret = webhook.secret or (None if present is None else present.secret)
    try:
        if secret is None:
            raise SecretError("a new webhook needs a secret, with which the receiver can check the signature")
        key_of(secret)
        url = checked_url(webhook.url)
    except (SecretError, UrlError) as error:
        raise ProblemError(Kind.WEBHOOK_REFUSED, f"{error}.") from error
    try:
        allowed(resolved(url), parts.sender.allow_networks)
    except UrlError as error:
        raise ProblemError(Kind.WEBHOOK_REFUSED, f"body.url: {error}.") from error
    except OSError:
        pass  # the name may exist later; until then the queue says what is wrong
    return webhook.model_copy(update={"secret": secret})


def _response(parts: EventParts, webhook: Webhook) -> Response:
    return item_response(webhook, _status(parts, webhook))


def _status(parts: EventParts, webhook: Webhook) -> WebhookStatus:
    with reading():
        pending, dead = parts.deliveries.counts().get(webhook.id, (0, 0))
    return WebhookStatus(
        **webhook.model_dump(exclude={"secret"}),
        has_secret=webhook.secret is not None,
        pending=pending,
        dead=dead,
        problem=parts.problem_of(webhook.id),
    )
