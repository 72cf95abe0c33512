"""A real router with certificates: what one tag can do to another, with access control and, as a control, without."""

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
from support.secured import SecuredSite, secured_site
from support.zenoh_router import wait_until

SITE = "default"
OF_B, POSE_OF_B, POSE_OF_A = keys.samples_key(SITE, "b"), keys.pose_key(SITE, "b"), keys.pose_key(SITE, "a")
CACHES = f"{keys.all_tags(SITE, 'samples')}/@adv/**"
ALL_REPLIES: dict[str, Any] = {
    "target": zenoh.QueryTarget.ALL,
    "consolidation": zenoh.ConsolidationMode.NONE,
    "accept_replies": zenoh.ReplyKeyExpr.ANY,
}


class Ears:
    """What a session hears: (kind, key, payload)."""

    def __init__(self) -> None:
        self.heard: list[tuple[str, str, bytes]] = []

    def __call__(self, message: zenoh.Sample) -> None:
        self.heard.append(
            (str(message.kind).removeprefix("SampleKind."), str(message.key_expr), bytes(message.payload))
        )

    def has(self, key: str, payload: bytes | None = None, kind: str = "PUT") -> bool:
        return any(k == kind and at == key and payload in (None, p) for k, at, p in self.heard)


class World:
    """The service and a reader, tag b at work with its cache, and tag a with a session that does as it likes."""

    def __init__(self, site: SecuredSite, stack: ExitStack) -> None:
        enter = stack.enter_context
        self.service, self.reader = enter(site.session("service")), enter(site.session("reader"))
        self.a = enter(site.session("a"))
        self.samples, self.alive, self.poses, self.stolen = Ears(), Ears(), Ears(), Ears()
        recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
        self._kept: list[object] = [
            zenoh.ext.declare_advanced_subscriber(
                self.service, keys.all_tags(SITE, "samples"), self.samples, recovery=recovery
            ),
            self.service.liveliness().declare_subscriber(keys.everything(SITE), self.alive, history=True),
            self.service.declare_queryable(keys.all_tags(SITE, "pose"), _answers(b"from the service")),
            self.reader.declare_subscriber(keys.all_tags(SITE, "pose"), self.poses),
            self.reader.declare_subscriber(keys.poses_key(SITE), self.poses),
        ]
        self.b = enter(TagClient("b", connect=read_credentials(site.folder.bundle("b")).session, connect_timeout_s=10))
        wait_until(lambda: self.alive.has(keys.tag_alive_key(SITE, "b")))

    def keep(self, *declared: object) -> None:
        self._kept.extend(declared)

    def work(self) -> None:
        """Honest traffic, which must pass in any case and after what was done before it."""
        self.b.publish_range(1, 1.0)
        self.b.flush()
        own = keys.samples_key(SITE, "a")
        mark = str(time.monotonic_ns()).encode()

        def passed() -> bool:
            self.a.put(own, mark)
            self.service.put(POSE_OF_B, mark)
            return self.samples.has(own, mark) and self.samples.has(OF_B) and self.poses.has(POSE_OF_B, mark)

        wait_until(passed)


def _answers(payload: bytes) -> Callable[[zenoh.Query], None]:
    def answer(query: zenoh.Query) -> None:
        with query:
            key = POSE_OF_B if "*" in str(query.key_expr) else str(query.key_expr)
            query.reply(key.replace("/@adv", ""), payload)

    return answer


def asked(session: zenoh.Session, selector: str, **how: Any) -> list[bytes]:
    replies = session.get(selector, timeout=2.0, **how)
    return [bytes(reply.ok.payload) for reply in replies if reply.ok is not None]


def alive_as_told_to(session: zenoh.Session) -> list[str]:
    replies = session.liveliness().get(keys.all_tags(SITE, "alive"), timeout=2.0)
    return [key for reply in replies if reply.ok is not None and "ghost" not in (key := str(reply.ok.key_expr))]


def attempts(world: World) -> dict[str, Callable[[], bool]]:
    """What a does, at once, and whether it has succeeded, by name."""
    a, samples, alive, poses, stolen = world.a, world.samples, world.alive, world.poses, world.stolen
    a.put(OF_B, b"spoofed")
    a.delete(OF_B)
    a.put(POSE_OF_B, b"forged")
    a.put(POSE_OF_A, b"forged")
    a.put(keys.poses_key(SITE), b"forged")
    tokens = [
        a.liveliness().declare_token(key)
        for key in (keys.tag_alive_key(SITE, "ghost"), keys.service_alive_key(SITE, "ghost"))
    ]
    spies = [
        a.declare_subscriber(OF_B, stolen),
        a.declare_subscriber(keys.all_tags(SITE, "pose"), stolen),
        a.liveliness().declare_subscriber(keys.all_tags(SITE, "alive"), stolen, history=True),
    ]
    liars = [
        a.declare_queryable(POSE_OF_B, _answers(b"a lie")),
        a.declare_queryable(f"{OF_B}/@adv/pub/liar", _answers(b"a lie")),
    ]
    world.keep(tokens, spies, liars)
    every: dict[str, Any] = {"target": zenoh.QueryTarget.ALL}
    return {
        "puts samples of b": lambda: samples.has(OF_B, b"spoofed"),
        "deletes samples of b": lambda: samples.has(OF_B, kind="DELETE"),
        "puts the pose of b": lambda: poses.has(POSE_OF_B, b"forged"),
        "puts its own pose": lambda: poses.has(POSE_OF_A, b"forged"),
        "puts the frame of all poses": lambda: poses.has(keys.poses_key(SITE), b"forged"),
        "pretends that another tag is alive": lambda: alive.has(keys.tag_alive_key(SITE, "ghost")),
        "pretends to be a service": lambda: alive.has(keys.service_alive_key(SITE, "ghost")),
        "hears samples of b": lambda: stolen.has(OF_B),
        "hears poses of b": lambda: stolen.has(POSE_OF_B),
        "hears that b is alive": lambda: stolen.has(keys.tag_alive_key(SITE, "b")),
        "asks who is alive": lambda: alive_as_told_to(a) != [],
        "asks for the pose of b": lambda: b"from the service" in asked(a, POSE_OF_B, **every),
        "asks for all poses": lambda: b"from the service" in asked(a, keys.all_tags(SITE, "pose"), **every),
        "asks for the cache of b": lambda: set(asked(a, CACHES, **ALL_REPLIES)) - {b"a lie"} != set(),
        "answers for the pose of b": lambda: b"a lie" in asked(world.reader, POSE_OF_B, **every),
        "answers for the cache of b": lambda: b"a lie" in asked(world.service, CACHES, **ALL_REPLIES),
    }


@pytest.mark.parametrize("access_control", [True, False], ids=["guarded", "control"])
def test_a_tag_speaks_only_for_itself_and_without_access_control_every_attempt_succeeds(
    tmp_path: Path, access_control: bool
) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    with ExitStack() as stack:
        stack.enter_context(site.router(access_control))
        world = World(site, stack)
        world.work()
        done = attempts(world)
        for _ in range(3):
            world.work()
        if access_control:
            assert [name for name, succeeded in done.items() if succeeded()] == []
        else:
            for name, succeeded in done.items():
                end_s = time.monotonic() + 10.0
                while not (ok := succeeded()) and time.monotonic() < end_s:
                    world.work()
                assert ok, f"the check cannot fail: {name}"


def test_a_tag_reads_its_own_pose_and_its_cache_answers_the_service(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    with ExitStack() as stack:
        stack.enter_context(site.router())
        world = World(site, stack)
        world.work()
        assert asked(world.a, POSE_OF_A) == [b"from the service"]
        assert len(asked(world.service, f"{CACHES}?_max=10", **ALL_REPLIES)) == 1


def test_a_revoked_tag_and_one_without_certificate_are_shut_out(tmp_path: Path) -> None:
    site = secured_site(tmp_path / "security", "a", "b")
    site.folder.revoke_tag("a")
    plain = SessionSettings(connect=site.endpoint, ca=tmp_path / "security" / "ca.pem")
    ears = Ears()
    with site.router(), site.session("service") as service, site.session("a") as a, site.session("b") as b:
        with service.declare_subscriber(keys.all_tags(SITE, "samples"), ears):

            def passed() -> bool:
                a.put(keys.samples_key(SITE, "a"), b"revoked")
                b.put(OF_B, b"admitted")
                return ears.has(OF_B)

            wait_until(passed)
            passed()
            wait_until(lambda: len(ears.heard) >= 2)
            assert {key for _, key, _ in ears.heard} == {OF_B}
        with pytest.raises(ConnectError, match="the certificates"):
            TagClient("c", connect=plain, connect_timeout_s=0.7).open()
