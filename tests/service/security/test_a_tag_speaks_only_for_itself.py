"""What one tag can do to another on a real router with certificates: with access control, and without as a control."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh
import zenoh.ext

from dropanchor_schemas import keys
from dropanchor_tag_client import ConnectError, SessionSettings, TagClient, read_credentials
from support.patience import PATIENCE_S
from support.secured import SecuredSite, secured_site
from support.zenoh_router import wait_until

SITE = "default"
HEALTH_OF_B, SETTINGS_OF_B = keys.health_key(SITE, "b"), keys.settings_key(SITE, "b")
OF_B, POSE_OF_B, POSE_OF_A = keys.samples_key(SITE, "b"), keys.pose_key(SITE, "b"), keys.pose_key(SITE, "a")
CACHES = f"{keys.all_tags(SITE, 'samples')}/@adv/**"
ALL_REPLIES: dict[str, Any] = {
    "target": zenoh.QueryTarget.ALL,
    "consolidation": zenoh.ConsolidationMode.NONE,
    "accept_replies": zenoh.ReplyKeyExpr.ANY,
}


class Received:
    """The messages that a session receives: (kind, key, payload)."""

    def __init__(self) -> None:
        self.messages: list[tuple[str, str, bytes]] = []

    def __call__(self, message: zenoh.Sample) -> None:
        self.messages.append(
            (str(message.kind).removeprefix("SampleKind."), str(message.key_expr), bytes(message.payload))
        )

    def has(self, key: str, payload: bytes | None = None, kind: str = "PUT") -> bool:
        return any(k == kind and at == key and payload in (None, p) for k, at, p in self.messages)


class World:
    """The service, a reader, tag b with a normal client and its cache, and tag a with an attacker's session."""

    def __init__(self, site: SecuredSite, stack: ExitStack) -> None:
        enter = stack.enter_context
        self.service, self.reader = enter(site.session("service")), enter(site.session("reader"))
        self.a = enter(site.session("a"))
        self.samples, self.alive, self.poses, self.stolen = Received(), Received(), Received(), Received()
        self.health, self.settings = Received(), Received()
        recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
        self._kept: list[object] = [
            zenoh.ext.declare_advanced_subscriber(
                self.service, keys.all_tags(SITE, "samples"), self.samples, recovery=recovery
            ),
            self.service.liveliness().declare_subscriber(keys.everything(SITE), self.alive, history=True),
            self.service.liveliness().declare_subscriber(keys.all_owners("yard"), self.alive, history=True),
            self.service.declare_subscriber(keys.all_tags(SITE, "health"), self.health),
            self.service.declare_subscriber(keys.all_tags(SITE, "settings"), self.settings),
            self.service.declare_queryable(keys.all_tags(SITE, "settings"), _answers(b"settings", SETTINGS_OF_B)),
            self.service.declare_queryable(keys.all_tags(SITE, "pose"), _answers(b"from the service")),
            self.reader.declare_subscriber(keys.all_tags(SITE, "pose"), self.poses),
            self.reader.declare_subscriber(keys.poses_key(SITE), self.poses),
        ]
        self.b = enter(
            TagClient("b", connect=read_credentials(site.folder.bundle("b")).session, connect_timeout_s=PATIENCE_S)
        )
        wait_until(lambda: self.alive.has(keys.tag_alive_key(SITE, "b")))

    def keep(self, *declared: object) -> None:
        self._kept.extend(declared)

    def exchange(self) -> None:
        """Send permitted messages and wait until they arrive, and with them whatever was sent before."""
        self.b.publish_range(1, 1.0)
        self.b.flush()
        self.b.publish_health(firmware="b")
        own = keys.samples_key(SITE, "a")
        mark = str(time.monotonic_ns()).encode()

        def passed() -> bool:
            self.a.put(own, mark)
            self.service.put(POSE_OF_B, mark)
            return self.samples.has(own, mark) and self.samples.has(OF_B) and self.poses.has(POSE_OF_B, mark)

        wait_until(passed)


def _answers(payload: bytes, otherwise: str = POSE_OF_B) -> Callable[[zenoh.Query], None]:
    def answer(query: zenoh.Query) -> None:
        with query:
            key = otherwise if "*" in str(query.key_expr) else str(query.key_expr)
            query.reply(key.replace("/@adv", ""), payload)

    return answer


def query_payloads(session: zenoh.Session, selector: str, **how: Any) -> list[bytes]:
    replies = session.get(selector, timeout=PATIENCE_S, **how)
    return [bytes(reply.ok.payload) for reply in replies if reply.ok is not None]


def live_tags(session: zenoh.Session) -> list[str]:
    replies = session.liveliness().get(keys.all_tags(SITE, "alive"), timeout=PATIENCE_S)
    return [key for reply in replies if reply.ok is not None and "ghost" not in (key := str(reply.ok.key_expr))]


def start_attacks(world: World) -> dict[str, Callable[[], bool]]:
    """Start every attack of a. Return, by name, functions that say whether it succeeded."""
    a, samples, alive, poses, stolen = world.a, world.samples, world.alive, world.poses, world.stolen
    a.put(OF_B, b"spoofed")
    a.delete(OF_B)
    a.put(HEALTH_OF_B, b"{}")
    a.put(SETTINGS_OF_B, b"forged")
    a.put(POSE_OF_B, b"forged")
    a.put(POSE_OF_A, b"forged")
    a.put(keys.poses_key(SITE), b"forged")
    tokens = [
        a.liveliness().declare_token(key)
        for key in (keys.tag_alive_key(SITE, "ghost"), keys.service_alive_key(SITE, "ghost"), keys.owner_key("yard", 9))
    ]
    subscribers = [
        a.declare_subscriber(OF_B, stolen),
        a.declare_subscriber(HEALTH_OF_B, stolen),
        a.declare_subscriber(keys.all_tags(SITE, "pose"), stolen),
        a.liveliness().declare_subscriber(keys.all_tags(SITE, "alive"), stolen, history=True),
    ]
    queryables = [
        a.declare_queryable(POSE_OF_B, _answers(b"a lie")),
        a.declare_queryable(f"{OF_B}/@adv/pub/liar", _answers(b"a lie")),
    ]
    world.keep(tokens, subscribers, queryables)
    all_targets: dict[str, Any] = {"target": zenoh.QueryTarget.ALL}
    return {
        "puts samples of b": lambda: samples.has(OF_B, b"spoofed"),
        "deletes samples of b": lambda: samples.has(OF_B, kind="DELETE"),
        "reports the health of b": lambda: world.health.has(HEALTH_OF_B, b"{}"),
        "changes the settings of b": lambda: world.settings.has(SETTINGS_OF_B, b"forged"),
        "queries the settings of b": lambda: b"settings" in query_payloads(a, SETTINGS_OF_B, **all_targets),
        "receives the health of b": lambda: stolen.has(HEALTH_OF_B),
        "puts the pose of b": lambda: poses.has(POSE_OF_B, b"forged"),
        "puts its own pose": lambda: poses.has(POSE_OF_A, b"forged"),
        "puts the frame of all poses": lambda: poses.has(keys.poses_key(SITE), b"forged"),
        "pretends that another tag is alive": lambda: alive.has(keys.tag_alive_key(SITE, "ghost")),
        "pretends to own a bucket": lambda: alive.has(keys.owner_key("yard", 9)),
        "pretends to be a service": lambda: alive.has(keys.service_alive_key(SITE, "ghost")),
        "receives samples of b": lambda: stolen.has(OF_B),
        "receives poses of b": lambda: stolen.has(POSE_OF_B),
        "receives that b is alive": lambda: stolen.has(keys.tag_alive_key(SITE, "b")),
        "queries who is alive": lambda: live_tags(a) != [],
        "queries the pose of b": lambda: b"from the service" in query_payloads(a, POSE_OF_B, **all_targets),
        "queries all poses": lambda: (
            b"from the service" in query_payloads(a, keys.all_tags(SITE, "pose"), **all_targets)
        ),
        "queries the cache of b": lambda: set(query_payloads(a, CACHES, **ALL_REPLIES)) - {b"a lie"} != set(),
        "answers for the pose of b": lambda: b"a lie" in query_payloads(world.reader, POSE_OF_B, **all_targets),
        "answers for the cache of b": lambda: b"a lie" in query_payloads(world.service, CACHES, **ALL_REPLIES),
    }


@pytest.mark.parametrize("access_control", [True, False], ids=["guarded", "control"])
def test_a_tag_speaks_only_for_itself_and_without_access_control_every_attack_succeeds(
    tmp_path: Path, access_control: bool
) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    with ExitStack() as stack:
        stack.enter_context(site.router(access_control))
        world = World(site, stack)
        world.exchange()
        done = start_attacks(world)
        for _ in range(3):
            world.exchange()
        if access_control:
            assert [name for name, succeeded in done.items() if succeeded()] == []
        else:
            for name, succeeded in done.items():
                end_s = time.monotonic() + PATIENCE_S
                while not (ok := succeeded()) and time.monotonic() < end_s:
                    world.exchange()
                assert ok, f"this attack never succeeds, so the guarded test proves nothing: {name}"


def test_a_tag_reads_its_own_pose_its_cache_answers_the_service_and_services_see_who_owns_a_bucket(
    tmp_path: Path,
) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    with ExitStack() as stack:
        stack.enter_context(site.router())
        world = World(site, stack)
        world.exchange()
        assert query_payloads(world.a, POSE_OF_A) == [b"from the service"]
        with site.session("service") as successor:
            world.keep(successor.liveliness().declare_token(keys.owner_key("yard", 2)))
            wait_until(lambda: world.alive.has(keys.owner_key("yard", 2)))
        assert len(query_payloads(world.service, f"{CACHES}?_max=10", **ALL_REPLIES)) == 1


def test_a_tag_reports_its_own_health_and_reads_its_own_settings(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    with ExitStack() as stack:
        stack.enter_context(site.router())
        world = World(site, stack)
        world.exchange()
        wait_until(lambda: world.health.has(HEALTH_OF_B))
        own, received = keys.settings_key(SITE, "a"), Received()
        world.keep(world.a.declare_subscriber(own, received))
        assert query_payloads(world.a, own) == [b"settings"]

        def passed() -> bool:
            world.service.put(own, b"new")
            return received.has(own, b"new")

        wait_until(passed)


def test_a_revoked_tag_and_one_without_a_certificate_are_refused(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    site.folder.revoke_tag("a")
    plain = SessionSettings(connect=site.endpoint, ca=tmp_path / "security" / "ca.pem")
    received = Received()
    with site.router(), site.session("service") as service, site.session("a") as a, site.session("b") as b:
        with service.declare_subscriber(keys.all_tags(SITE, "samples"), received):

            def passed() -> bool:
                a.put(keys.samples_key(SITE, "a"), b"revoked")
                b.put(OF_B, b"admitted")
                return received.has(OF_B)

            wait_until(passed)
            passed()
            wait_until(lambda: len(received.messages) >= 2)
            assert {key for _, key, _ in received.messages} == {OF_B}
        with pytest.raises(ConnectError, match="the certificates"):
            TagClient("c", connect=plain, connect_timeout_s=0.7).open()
