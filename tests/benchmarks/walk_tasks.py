"""The tasks of an operator's day, each with the ways to do it, the shortest first."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from playwright.sync_api import Locator

from benchmarks.walk_place import WalkPlace
from benchmarks.walker import Walker, Way
from dropanchor_service.api.routes.event_examples import SECRET

PLAN = b"<svg xmlns='http://www.w3.org/2000/svg' width='400' height='300'><path d='M10 10h380v280H10z'/></svg>"
SHORTCUT_OF_SEARCH = "/"
FREE, BESIDE = (40.0, 40.0), (40.0, 150.0)
"""Places of the map without a tag: pixels from its top left corner."""


@dataclass
class Tasks:
    """place: where they are done. suffix: makes the names of what is created differ from walk to walk."""

    place: WalkPlace
    suffix: str

    def all(self) -> Mapping[str, Sequence[Way]]:
        """Return the ways of each task by what an operator would call it."""
        return {
            "find a tag by name, see where and how sure": (self.find_by_enter, self.find_by_click),
            "say “the tag is here”": (self.start_by_menu, self.start_by_settings),
            "make a zone": (self.zone_by_menu, self.zone_by_list),
            "make a rule with a webhook alert": (self.alert_with_made_secret, self.alert_with_own_secret),
            "add a floor plan and place it": (self.plan, self.plan_on_phone),
            "replay the last minutes": (self.replay_at_once, self.replay_after_search),
            "measure a distance": (self.measure_by_menu, self.measure_by_tool),
            "export a track": (self.export_by_menu, self.export_from_past, self.export_after_search),
            "rename and group a tag": (self.rename_by_menu, self.rename_by_click),
            "follow three tags": (self.follow_three, self.follow_three_on_phone),
            "see who is lost": (self.lost,),
            "see who is where": (self.headcount,),
            "move an anchor, and undo that": (self.anchor, self.anchor_on_phone),
        }

    @property
    def label(self) -> str:
        return self.place.labels[len(self.place.labels) // 2]

    @property
    def tag(self) -> str:
        return f"tag-{len(self.place.labels) // 2 + 1:03}"

    def search(self, walker: Walker, text: str) -> None:
        walker.press(SHORTCUT_OF_SEARCH)
        walker.type(text)

    def row(self, walker: Walker, tag: str, button: Literal["left", "right"] = "left") -> None:
        """Click the row of a tag, after a search where the list is long."""
        label = self.place.labels[int(tag.removeprefix("tag-")) - 1]
        if len(self.place.labels) > 6:
            self.search(walker, label)
        walker.click(self.row_of(walker, label), button=button)

    def ask_row(self, walker: Walker, tag: str, item: str) -> None:
        """Right-click the row of a tag and choose an item of the menu."""
        self.row(walker, tag, "right")
        walker.click(walker.button(item, "menuitem"))

    def row_of(self, walker: Walker, label: str) -> Locator:
        cell = re.compile(rf"^{re.escape(label)}( \(.*)?$")
        return walker.page.get_by_role("gridcell", name=cell).locator("visible=true").first

    def is_shown(self, walker: Walker) -> None:
        """See the name of the tag and how sure its position is."""
        walker.see(lambda: walker.page.get_by_role("heading", name=self.label, exact=True).is_visible())
        walker.see(lambda: walker.page.get_by_text(re.compile(r"± ?\d")).locator("visible=true").count())

    def find_by_enter(self, walker: Walker) -> None:
        self.search(walker, self.label)
        walker.press("Enter")
        self.is_shown(walker)

    def find_by_click(self, walker: Walker) -> None:
        self.search(walker, self.label)
        walker.click(self.row_of(walker, self.label))
        self.is_shown(walker)

    def has_start(self, walker: Walker) -> None:
        walker.see(lambda: self.place.bench.answers.site.tag_settings(self.tag).start)

    def start_by_menu(self, walker: Walker) -> None:
        self.search(walker, self.label)
        walker.press("Enter")
        self.is_shown(walker)
        walker.ask(FREE, "ist hier")
        walker.press("Enter")
        self.has_start(walker)

    def start_by_settings(self, walker: Walker) -> None:
        self.row(walker, self.tag)
        walker.click(walker.page.get_by_text("Einstellungen", exact=True).locator("visible=true").last)
        walker.click(walker.button("ist hier"))
        walker.click_map(FREE)
        walker.click(walker.button("Start festlegen"))
        self.has_start(walker)

    def zone_by_menu(self, walker: Walker) -> None:
        walker.ask(FREE, "Runde Zone")
        self.name_zone(walker)

    def zone_by_list(self, walker: Walker) -> None:
        walker.click(walker.page.get_by_role("heading", name="Zonen", exact=True))
        walker.click(walker.button("Neuer Kreis|Neue runde"))
        walker.click_map(FREE)
        self.name_zone(walker)

    def name_zone(self, walker: Walker) -> None:
        zones = self.place.events.items.zones
        before = len(zones.all)
        walker.write(walker.field("^Name"), f"Tor {self.suffix}")
        walker.click(walker.button("Zone speichern"))
        walker.see(lambda: len(zones.all) > before)

    def alert_with_made_secret(self, walker: Walker) -> None:
        self.alert(walker, None)

    def alert_with_own_secret(self, walker: Walker) -> None:
        self.alert(walker, SECRET)

    def alert(self, walker: Walker, secret: str | None) -> None:
        """Make a webhook and a rule, with a secret of the page or with one that was made elsewhere."""
        destinations, rules = self.place.events.destinations, self.place.events.items.rules
        found, known = len(destinations.all), len(rules.all)
        walker.click(walker.page.get_by_role("heading", name="Alarme", exact=True))
        walker.click(walker.button("Neuer Webhook"))
        walker.write(walker.field("^Name"), f"Empfang {self.suffix}")
        walker.write(walker.field("^URL"), "http://127.0.0.1:9/alarm")
        if secret is not None:
            walker.write(walker.field("Geheimnis|Schlüssel"), secret)
        walker.click(walker.button("Ziel speichern"))
        walker.see(lambda: len(destinations.all) > found)
        if walker.button("^Neu.*zu nah").count() == 0:
            walker.press("Escape")
        walker.click(walker.button("^Neu.*zu nah"))
        walker.write(walker.field("^Name"), f"Abstand {self.suffix}")
        walker.click(walker.button("Regel speichern"))
        walker.see(lambda: len(rules.all) > known)

    def plan(self, walker: Walker) -> None:
        plans = self.place.plans
        before = set(plans.all)
        walker.click(walker.button("Grundrisse"))
        walker.choose_file(walker.page.locator("input[type=file]").last, PLAN)
        walker.click(walker.button("Plan hinzufügen"))
        walker.see(lambda: walker.page.evaluate("dropanchor.draft()"), within_s=10)  # the first plan starts a process
        middle = walker.page.evaluate(
            "dropanchor.draft().corners.reduce(([x, y], [a, b]) => [x + a / 4, y + b / 4], [0, 0])"
        )
        walker.drag((middle[0], middle[1]), (middle[0] + 20, middle[1] + 30))
        walker.click(walker.button("Plan speichern"))
        walker.see(lambda: set(plans.all) > before)

    def plan_on_phone(self, walker: Walker) -> None:
        walker.click(walker.button("Werkzeuge"))
        self.plan(walker)

    def replay_at_once(self, walker: Walker) -> None:
        walker.click(walker.button("Vergangenheit"))
        walker.click(walker.button("^Abspielen"))
        self.is_replayed(walker)

    def replay_after_search(self, walker: Walker) -> None:
        """Find the stored minutes at the end of the slider first."""
        walker.click(walker.button("Vergangenheit"))
        self.go_to_the_end(walker)
        walker.click(walker.button("^Abspielen"))
        self.is_replayed(walker)

    def go_to_the_end(self, walker: Walker) -> None:
        walker.click(walker.page.get_by_role("slider").locator("visible=true").first)
        walker.press("End", "PageDown")

    def is_replayed(self, walker: Walker) -> None:
        walker.see(lambda: walker.page.evaluate("dropanchor.past()?.playing && dropanchor.tags().length > 0"))

    def measure_by_menu(self, walker: Walker) -> None:
        walker.ask(FREE, "messen")
        walker.click_map(BESIDE)
        self.is_measured(walker)

    def measure_by_tool(self, walker: Walker) -> None:
        walker.click(walker.button("^Messen"))
        walker.click_map(FREE)
        walker.click_map(BESIDE)
        self.is_measured(walker)

    def is_measured(self, walker: Walker) -> None:
        walker.see(lambda: walker.page.get_by_text(re.compile(r"\d m, \d+°")).locator("visible=true").count())

    def export_by_menu(self, walker: Walker) -> None:
        self.ask_row(walker, self.tag, "Auswahl hinzunehmen")
        self.save(walker)

    def export_from_past(self, walker: Walker) -> None:
        self.row(walker, self.tag)
        walker.click(walker.button("Vergangenheit"))
        self.save(walker)

    def export_after_search(self, walker: Walker) -> None:
        self.row(walker, self.tag)
        walker.click(walker.button("Vergangenheit"))
        self.go_to_the_end(walker)
        self.save(walker)

    def save(self, walker: Walker) -> None:
        button = walker.button("^CSV")
        if (
            button.count() == 0
            and (fold := walker.page.get_by_text("Gruppe und Export").locator("visible=true")).count()
        ):
            walker.click(fold.first)
        walker.see(button.count)
        with walker.page.expect_download(timeout=3000):
            walker.click(button)

    def rename_by_menu(self, walker: Walker) -> None:
        self.ask_row(walker, "tag-001", "^Einstellungen")
        self.rename(walker)

    def rename_by_click(self, walker: Walker) -> None:
        self.row(walker, "tag-001")
        walker.click(walker.page.get_by_text("Einstellungen", exact=True).locator("visible=true").last)
        self.rename(walker)

    def rename(self, walker: Walker) -> None:
        group = f"Halle {self.suffix}"
        walker.write(walker.field("^Name"), self.place.labels[0])
        walker.write(walker.field(r"^\s*Gruppe\s*$"), group)
        walker.click(walker.button("Einstellungen speichern"))
        walker.see(lambda: self.place.bench.answers.site.tag_settings("tag-001").group == group)

    def follow_three_on_phone(self, walker: Walker) -> None:
        """Take the first tag into a selection, as a long press does, so that each further tap adds one."""
        first, *others = self.place.labels[:3]
        walker.click(self.row_of(walker, first), button="right")
        walker.click(walker.button("Zur Auswahl hinzunehmen", "menuitem"))
        for label in others:
            walker.click(self.row_of(walker, label))
        self.follow(walker)

    def follow_three(self, walker: Walker) -> None:
        for label in self.place.labels[:3]:
            walker.click(self.row_of(walker, label), *(() if label == self.place.labels[0] else ("Control",)))
        self.follow(walker)

    def follow(self, walker: Walker) -> None:
        walker.click(walker.button("^Folgen"))
        walker.see(lambda: walker.page.get_by_role("row", selected=True).locator("visible=true").count() == 3)
        walker.see(lambda: "follow" in walker.page.url)

    def lost(self, walker: Walker) -> None:
        walker.click(walker.button("^Verloren"))
        walker.see(lambda: walker.page.get_by_text(f"1 von {len(self.place.labels)} Tags").is_visible())
        walker.see(self.row_of(walker, self.place.labels[-1]).is_visible)

    def headcount(self, walker: Walker) -> None:
        walker.click(walker.page.get_by_role("heading", name="Zonen", exact=True))
        walker.click(walker.button("Wer ist wo"))
        walker.see(lambda: walker.page.get_by_text("In keiner Zone").locator("visible=true").count())

    def anchor(self, walker: Walker) -> None:
        site = self.place.bench.answers.site
        walker.click(walker.button("Anker einrichten"))
        x, y = walker.page.evaluate("dropanchor.anchors()[0].pixel")
        walker.drag((x, y), (x + 40, y))
        walker.click(walker.button("^Verschieben"))
        walker.see(lambda: site.site.anchors[0].x != 0)
        walker.click(walker.button("^Rückgängig"))
        walker.see(lambda: site.site.anchors[0].x == 0)

    def anchor_on_phone(self, walker: Walker) -> None:
        walker.click(walker.button("Werkzeuge"))
        self.anchor(walker)
