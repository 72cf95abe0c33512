"""Plans and their images are kept through a restart, and images that no plan uses do not pile up."""

from pathlib import Path

import pytest

from dropanchor_schemas.plans import Placement, Plan, PlanImage
from dropanchor_service.plans.reading.messages import Description, ReadPlan
from dropanchor_service.plans.store import MAX_UNUSED, ImageMissingError, PlanStore
from dropanchor_service.store.preconditions import ChangedMeanwhileError


def add(store: PlanStore, content: bytes = b"pixels") -> PlanImage:
    return store.add_image(ReadPlan(Description(width_px=4, height_px=2), content))


def plan(image: PlanImage, name: str = "hall") -> Plan:
    return Plan(id=name, image=image, placement=Placement(x=0.0, y=0.0, m_per_px=0.1))


def put(store: PlanStore, made: Plan) -> None:
    store.put(made.id, made)


def files(folder: Path) -> set[str]:
    return {path.name for path in (folder / "plans").iterdir()}


def test_a_restart_keeps_plans_with_their_images_and_nothing_else(tmp_path: Path) -> None:
    store = PlanStore(tmp_path)
    used, unused = add(store), add(store, b"others")
    put(store, plan(used))
    (tmp_path / "plans" / f"{unused.id}.png.part").write_bytes(b"half")
    (tmp_path / "plans" / "notes.txt").write_text("of a person")
    again = PlanStore(tmp_path)
    assert again.all == {"hall": plan(used)}
    assert again.content(used) == b"pixels"
    assert again.image(unused.id) is None
    assert files(tmp_path) == {f"{used.id}.png", "notes.txt"}


def test_the_images_of_plans_that_were_damaged_stay_until_somebody_has_looked(tmp_path: Path) -> None:
    store = PlanStore(tmp_path)
    used = add(store)
    put(store, plan(used))
    whole = (tmp_path / "plans.json").read_bytes()
    for name in ("plans.json", "plans.json.last-good"):
        (tmp_path / name).write_bytes(whole[:-9])
    for _ in range(2):
        assert PlanStore(tmp_path).all == {}
        assert files(tmp_path) == {f"{used.id}.png"}
    (aside,) = tmp_path.glob("plans.json.damaged-*")
    aside.unlink()
    (tmp_path / "plans.json").write_bytes(whole)  # mended by hand
    assert PlanStore(tmp_path).content(used) == b"pixels"


@pytest.mark.parametrize("in_memory", [True, False])
def test_a_plan_needs_an_image_that_was_uploaded(tmp_path: Path, in_memory: bool) -> None:
    store = PlanStore(None if in_memory else tmp_path)
    image = add(store)
    for wrong in (image.model_copy(update={"id": "0" * 32}), image.model_copy(update={"width_px": 5})):
        with pytest.raises(ImageMissingError):
            put(store, plan(wrong))
    before = store.version
    put(store, plan(image))
    assert store.version > before
    assert store.content(image) == b"pixels"


def test_the_image_of_a_deleted_plan_stays_for_an_undo_until_newer_ones_follow(tmp_path: Path) -> None:
    store = PlanStore(tmp_path)
    image = add(store)
    put(store, plan(image))
    for number in range(MAX_UNUSED + 5):
        add(store, f"image {number}".encode())
    assert len(files(tmp_path)) == MAX_UNUSED + 1
    store.remove("hall")
    put(store, plan(image))
    assert store.content(image) == b"pixels"
    store.remove("hall")
    for number in range(MAX_UNUSED):
        add(store, f"newer {number}".encode())
    assert store.content(image) is None
    with pytest.raises(ImageMissingError):
        put(store, plan(image))


def test_a_change_that_was_not_expected_is_refused() -> None:
    store = PlanStore(None)
    put(store, plan(add(store)))
    with pytest.raises(ChangedMeanwhileError):
        store.put("hall", plan(add(store)), lambda current: current is None)
    with pytest.raises(ChangedMeanwhileError):
        store.remove("hall", lambda _: False)
    with pytest.raises(KeyError):
        store.remove("roof")
