"""What a tag and a reader of one site can do to another on a real router, with access control and without."""

import time
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest
import zenoh
import zenoh.ext

from dropanchor_schemas import keys
from dropanchor_tag_client import TagClient, read_credentials
from support.patience import PATIENCE_S
from support.secured import SecuredSite, secured_site
from support.zenoh_router import wait_until

A, B = "north", "south"
SAMPLES_A, SAMPLES_B = keys.samples_key(A, "cart"), keys.samples_key(B, "cart")
POSE_A, POSE_B = keys.pose_key(A, "cart"), keys.pose_key(B, "cart")
ALL: dict[str, Any] = {"target": zenoh.QueryTarget.ALL, "timeout": 2.0}


def two_sites(folder: Path) -> SecuredSite:
    """Return a router of two sites, each with a tag `cart`."""
    site = secured_site(folder, "cart", site=A)
    site.folder.add_site(B, days=30)
    site.folder.add_tag("cart", days=30, site=B)
    return site


class World:
    """A service of both sites, and of the site A a tag `cart` and a reader. Each list holds what somebody received."""

    def __init__(self, site: SecuredSite, stack: ExitStack) -> None:
        enter = stack.enter_context
        self.service, self.cart_a = enter(site.session("service")), enter(site.session("cart"))
        self.reader_a, self.reader = enter(site.session(f"reader-{A}")), enter(site.session("reader"))
        self.samples: list[tuple[str, bytes]] = []
        self.poses: list[str] = []
        self.stolen: list[str] = []
        recovery = zenoh.ext.RecoveryConfig(periodic_queries=None, heartbeat=True)
        self._kept: list[object] = [
            zenoh.ext.declare_advanced_subscriber(
                self.service, keys.all_sites("samples"), self._on_samples, recovery=recovery
            ),
            self.service.declare_queryable(keys.all_sites("pose"), _answer),
            self.service.declare_queryable(keys.anchors_of_all_sites(), _answer),
            self.reader_a.declare_subscriber(keys.all_tags(A, "pose"), self._on_pose),
        ]
        bundle = site.folder.bundle(site.folder.table.common_name(B, "cart"))
        credentials = read_credentials(bundle)
        assert (credentials.tag, credentials.site) == ("cart", B)
        self.cart_b = enter(TagClient("cart", site=B, connect=credentials.session, connect_timeout_s=PATIENCE_S))

    def keep(self, *declared: object) -> None:
        self._kept.extend(declared)

    def _on_samples(self, message: zenoh.Sample) -> None:
        self.samples.append((str(message.key_expr), bytes(message.payload)))

    def _on_pose(self, message: zenoh.Sample) -> None:
        self.poses.append(str(message.key_expr))

    def steal(self, message: zenoh.Sample) -> None:
        self.stolen.append(str(message.key_expr))

    def exchange(self) -> None:
        """Send permitted messages of both sites and wait until they arrive, and with them what was sent before."""
        mark = str(time.monotonic_ns()).encode()
        self.cart_b.publish_range(1, 1.0)
        self.cart_b.flush()

        def passed() -> bool:
            self.cart_a.put(SAMPLES_A, mark)
            self.service.put(POSE_A, mark)
            self.service.put(POSE_B, mark)
            return (SAMPLES_A, mark) in self.samples and POSE_A in self.poses

        wait_until(passed)


def _answer(query: zenoh.Query) -> None:
    with query:
        if "*" not in str(query.key_expr):
            query.reply(str(query.key_expr), b"from the service")


def replies(session: zenoh.Session, key: str) -> list[bytes]:
    return [bytes(reply.ok.payload) for reply in session.get(key, **ALL) if reply.ok is not None]


def start_attacks(world: World) -> dict[str, Callable[[], bool]]:
    """Let the tag and the reader of A reach for B. Return, by name, functions that say whether it succeeded."""
    tag, reader = world.cart_a, world.reader_a
    tag.put(SAMPLES_B, b"spoofed")
    tag.put(keys.health_key(B, "cart"), b"{}")
    world.keep(
        tag.declare_subscriber(POSE_B, world.steal),
        tag.declare_subscriber(SAMPLES_B, world.steal),
        reader.declare_subscriber(keys.all_sites("pose"), world.steal),
    )
    return {
        "the tag puts samples of its namesake": lambda: (SAMPLES_B, b"spoofed") in world.samples,
        "the tag receives the pose of its namesake": lambda: POSE_B in world.stolen,
        "the tag receives samples of its namesake": lambda: SAMPLES_B in world.stolen,
        "the tag queries the pose of its namesake": lambda: replies(tag, POSE_B) != [],
        "the tag queries an anchor": lambda: replies(tag, keys.anchor_key(B, "1")) != [],
        "the reader queries a pose": lambda: replies(reader, POSE_B) != [],
        "the reader queries an anchor": lambda: replies(reader, keys.anchor_key(B, "1")) != [],
    }


@pytest.mark.parametrize("access_control", [True, False], ids=["guarded", "control"])
def test_a_tag_and_a_reader_stay_in_their_site_and_without_access_control_they_do_not(
    tmp_path: Path, access_control: bool
) -> None:
    site = two_sites(tmp_path / "security")
    with ExitStack() as stack:
        stack.enter_context(site.router(access_control))
        world = World(site, stack)
        world.exchange()
        done = start_attacks(world)
        for _ in range(3):
            world.exchange()
        if access_control:
            assert [name for name, succeeded in done.items() if succeeded()] == []
            _check_what_is_allowed(world)
            return
        for name, succeeded in done.items():
            end_s = time.monotonic() + PATIENCE_S
            while not (ok := succeeded()) and time.monotonic() < end_s:
                world.exchange()
            assert ok, f"this never succeeds, so the guarded test proves nothing: {name}"


def _check_what_is_allowed(world: World) -> None:
    """Check that tags of both sites reach the service, and that each reader reads what it may."""
    assert {key for key, _ in world.samples} == {SAMPLES_A, SAMPLES_B}
    caches = world.service.get(
        f"{keys.all_sites('samples')}/@adv/**?_max=10",
        consolidation=zenoh.ConsolidationMode.NONE,
        accept_replies=zenoh.ReplyKeyExpr.ANY,
        **ALL,
    )
    assert {str(reply.ok.key_expr) for reply in caches if reply.ok is not None} == {SAMPLES_B}
    assert replies(world.cart_a, POSE_A) == replies(world.reader_a, POSE_A) == [b"from the service"]
    assert replies(world.reader, POSE_B) == [b"from the service"]


def test_the_folder_names_the_sites_and_refuses_what_is_ambiguous(tmp_path: Path) -> None:
    folder = two_sites(tmp_path / "security").folder
    assert list(folder.table.admitted) == ["cart", f"{B}/cart"]
    assert folder.table.holder(f"{B}/cart") == (f"{B}/cart", B, "cart")
    assert {f"reader-{A}", f"reader-{B}"} <= folder.expiries().keys()
    for site, words in ((None, "say which site it is of, with --site: north, south"), ("west", "add-site west")):
        with pytest.raises(ValueError, match=words):
            folder.add_tag("lift", days=30, site=site)
    with pytest.raises(ValueError, match="is there already"):
        folder.add_site(B, days=30)
    with pytest.raises(ValueError, match="has a certificate already"):
        folder.add_tag(f"{B}/cart", days=30, site=A)
    with pytest.raises(ValueError, match="too long for a certificate"):
        folder.add_site("x" * 60, days=30)
    folder.revoke_tag("cart", site=B)
    assert list(folder.table.admitted) == ["cart"]
