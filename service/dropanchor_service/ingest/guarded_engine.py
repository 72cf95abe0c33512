"""Run the engine so that it follows changes of the sites, and so that a fault of one row harms no other row."""

import logging
from collections.abc import Iterable, Iterator, Sequence, Set

import numpy as np

from dropanchor_schemas.kinds import KINDS
from dropanchor_schemas.wire import Reason
from dropanchor_service.estimation.columns import TAG_SETTINGS, Array, PoseBatch, SampleBatch
from dropanchor_service.estimation.plausibility.check import Checked, SensorCheck
from dropanchor_service.estimation.plausibility.layout import make_checks
from dropanchor_service.estimation.protocols import Engine, FollowsAnchors, Restorable
from dropanchor_service.ingest.anchor_watch import AnchorWatch
from dropanchor_service.ingest.anchors import AnchorTable, have_moved
from dropanchor_service.ingest.configured import Configured
from dropanchor_service.ingest.decode import Decoded
from dropanchor_service.ingest.lost_pose import lost_pose
from dropanchor_service.ingest.measured_starts import MeasuredStarts, with_lasting_errors
from dropanchor_service.ingest.norths import NorthWatch
from dropanchor_service.ingest.quarantine import Quarantine
from dropanchor_service.ingest.references import PressureReferences
from dropanchor_service.ingest.starts import StartWatch
from dropanchor_service.ingest.survey_errors import widen
from dropanchor_service.ingest.told_heights import ToldHeights
from dropanchor_service.ingest.units import convert, has_units
from dropanchor_service.metrics.registry import Metrics
from dropanchor_service.runtime.logs import RareLog
from dropanchor_service.store import ServedSite, Sites
from dropanchor_service.store.anchor_doubts import AnchorDoubt
from dropanchor_service.store.records import enlarged


class GuardedEngine:
    """An engine that follows the sites and isolates rows that make it fail. Owned by one thread.

    The samples that it takes have the engine's index of an anchor, the poses that it gives the index within the site.
    """

    def __init__(self, engine: Engine, sites: Sites, metrics: Metrics) -> None:
        self._log = RareLog(logging.getLogger(__name__))
        self._engine = engine
        self._sites = sites
        self._metrics = metrics
        self.anchors = AnchorTable()
        self._configured: dict[int, Configured] = {}
        self._settings = np.zeros(0, TAG_SETTINGS)  # by row
        self._has_configured = np.zeros(0, bool)  # by row
        self._has_units = False  # whether any tag has other units than ours
        self.quarantine = Quarantine()
        self._sensors = SensorCheck()
        self._starts = StartWatch(engine, sites.rows.start_news)
        self._measured = MeasuredStarts()
        self._norths = NorthWatch(engine, sites.rows.norths)
        self._references = PressureReferences(engine)
        self._heights = ToldHeights()
        self._anchor_watch = AnchorWatch(sites.rows.anchor_doubts, self._anchor_id)

    @property
    def keeps_state(self) -> bool:
        """Return whether the engine's state can be saved and restored."""
        return isinstance(self._engine, Restorable)

    def state(self) -> dict[str, Array]:
        """Return the engine's state, anchors and settings, to be copied; empty if the engine keeps no state."""
        if not isinstance(self._engine, Restorable):
            return {}
        settings = self._settings[: len(self._sites.rows)]
        self._sensors.reserve(len(settings))
        checks = self._sensors.columns[: len(settings)]
        return {"anchors": self.anchors.places, "settings": settings, "checks": checks} | self._engine.state()

    def restore(self, state: dict[str, Array]) -> None:
        """Restore what `state` returned.

        Rows start afresh if their settings have changed since, and those that cannot follow an anchor that has moved.
        """
        assert isinstance(self._engine, Restorable)
        self.follow_sites()
        anchors, settings = self.anchors.places.copy(), state.pop("settings")
        kept = state.pop("anchors")
        anchors[: len(kept)] = kept
        self._sensors.columns = state.pop("checks")
        self._engine.set_anchors(anchors)
        self._engine.restore(state)
        moved = dict.fromkeys(self.anchors.sites[have_moved(self.anchors.places, anchors)].tolist())
        afresh = self._move([self._sites[index] for index in moved])
        self._settings = settings
        self._has_units = has_units(settings)
        for row, known in enumerate(settings):
            current = self._current(row)
            unchanged = current.columns().tobytes() == known.tobytes()
            if unchanged and row not in afresh:
                self._note(row, current)
                self._starts.resume(row, current.tag)
                self._norths.tell(row, current.tag)
                self._anchor_watch.begin(row)
                self._references.resume(self._sites.of_row(row).index, row, current.tag)
        self._has_configured = np.zeros(len(settings), bool)
        self._has_configured[list(self._configured)] = True

    def fresh(self, settings: Array) -> dict[str, Array]:
        """Return the engine's state of rows with these TAG_SETTINGS before the first sample; empty without one."""
        if not isinstance(self._engine, Restorable):
            return {}
        engine = type(self._engine)()
        for row, of_tag in enumerate(settings):
            engine.configure(row, of_tag)
        return engine.state() | {"checks": make_checks(len(settings))}

    def follow_sites(self) -> list[ServedSite]:
        """Apply the changes of the sites since the last call. Return the sites that have changed.

        Tracks follow an anchor that has moved. All rows of a site start afresh if one of its anchors has turned, and
        single rows if their settings have changed.
        """
        changed = self._sites.take_changed()
        changes = [self.anchors.follow(site) for site in changed]
        if not changed:
            return changed
        afresh = self._move([site for site, change in zip(changed, changes, strict=True) if change.moved])
        for site, change in zip(changed, changes, strict=True):
            self._follow_settings(site, afresh, restart=change.turned)
            if change.told:
                self._anchor_watch.told(self.anchors.of_site(site.index))
        return changed

    def _move(self, moved: Sequence[ServedSite]) -> set[int]:
        """Let the engine follow the anchors. Return the rows to start afresh. moved: sites whose anchors did."""
        if not isinstance(self._engine, FollowsAnchors):
            self._engine.set_anchors(self.anchors.places)
            return {tag.row for site in moved for tag in site.tags.all()}
        afresh = set(self._engine.move_anchors(self.anchors.places).tolist())
        self._starts.end_left()
        return afresh

    def _follow_settings(self, site: ServedSite, afresh: Set[int], restart: bool) -> None:
        """Apply the settings of the tags of a site. afresh: rows that lost their track. restart: start all afresh."""
        for tag in site.tags.all():
            configured, current = self._configured.get(tag.row), self._current(tag.row)
            if configured is None:
                continue
            if tag.row in afresh and not restart:
                self._configure(tag.row, start_known=not isinstance(self._engine, FollowsAnchors))
            elif not restart and current.is_turned_from(configured):
                self._turn(tag.row, current)
            elif restart or current.matters_after(configured):
                self._configure(tag.row)
            else:
                self._note(tag.row, current)

    def _turn(self, row: int, current: Configured) -> None:
        """Follow another declination: a row that knows north by itself goes on, and no other returns to its start."""
        if self._norths.turns(row, current.declination_rad):
            self._note(row, current)
            self._keep_settings(row, current.columns())
        else:
            self._configure(row, start_known=current.tag.start is None or not self._norths.has_left_start(row))

    def anchor_indices(self, rows: Array, numbers: Array) -> Array:
        """Return the engine's index for each anchor number that the tag of a row sent, -1 if its site lacks it."""
        return self.anchors.indices(self._sites.rows.sites(rows), numbers)

    def _anchor_id(self, index: int) -> str:
        """Return the id of an anchor, as its site has it."""
        store = self._sites[int(self.anchors.sites[index])].store
        return store.anchors_by_index()[int(self.anchors.own_indices(np.array([index]))[0])].id

    def follow_doubts(self, site: int, doubts: Iterable[AnchorDoubt]) -> None:
        """Doubt these anchors of a site, and no others, whatever the ranges say."""
        of_ids = {self._anchor_id(index): index for index in self.anchors.of_site(site)}
        self._anchor_watch.follow({of_ids[doubt.anchor]: doubt for doubt in doubts if doubt.anchor in of_ids})

    def prepare(self, row: int) -> None:
        """Configure a row before its first message arrives, so that the message does not wait for it."""
        if row not in self._configured:
            self._reserve(row + 1)
            self._configure(row)

    def restart(self, row: int) -> None:
        """Let a row start afresh, wherever its tag is now."""
        if row in self._configured:
            self._configure(row, start_known=False)

    def process(self, samples: SampleBatch, now_ns: int) -> Iterator[PoseBatch]:
        """Yield the poses of all rows. A row that makes the engine fail starts afresh."""
        for row in self._new_rows(samples):
            self._configure(row)
        checked = self._sensors.check(samples)
        for row, start in self._measured.look(checked.samples, self.anchors, self._settings["height"]):
            self._engine.configure(row, start.told_to(self._configured[row].columns()))
        usable = with_lasting_errors(checked.samples, self.anchors)
        for batch in self._bisected(usable, now_ns) if any(map(len, usable.columns())) else ():
            self._starts.look(batch)
            self._anchor_watch.look(batch)
            if self._anchor_watch.any_heard_several:
                widen(batch.poses, *self._anchor_watch.heard(batch.poses), self.anchors.places)
            self._sensors.mark(batch.poses)
            self._heights.mark(batch.poses)
            self._norths.look(now_ns)
            for column in (batch.poses, batch.innovations):
                column["anchor"] = self.anchors.own_indices(column["anchor"])
            yield batch
        if len(checked.found):
            self._note_findings(checked)
            unused = dict(zip((kind.name for kind in KINDS), checked.left_out, strict=True))
            yield PoseBatch(
                poses=checked.poses,
                rejected={Reason.SENSOR_FAULT: np.concatenate(checked.left_out)},
                unused={name: rows for name, rows in unused.items() if len(rows)},
            )

    def _note_findings(self, checked: Checked) -> None:
        """Tell what is wrong with sensors, and forget what was estimated with them."""
        for row in checked.found.tolist():
            self._sites.rows.findings.set(row, self._sensors.findings(row))
        for row in checked.failed.tolist():
            self.restart(row)

    def note_absurd(self, imu_rows: Array, imu_sizes: Array, range_rows: Array) -> None:
        """Note samples that no sensor can have measured. imu_sizes: the greatest value of each."""
        self._sensors.note_absurd(imu_rows, imu_sizes, range_rows)

    def convert(self, decoded: Decoded, of_row: Array) -> None:
        """Convert samples of tags whose units the operator has told, in place. of_row: of each message."""
        if self._has_units:
            convert(decoded, of_row, self._settings)

    def _new_rows(self, samples: SampleBatch) -> Sequence[int]:
        rows = [column["row"] for column in samples.columns() if len(column)]
        self._reserve(max((int(column.max()) for column in rows), default=-1) + 1)
        unknown = [column for column in rows if not self._has_configured[column].all()]
        return sorted({row for column in unknown for row in column[~self._has_configured[column]].tolist()})

    def _reserve(self, rows: int) -> None:
        if rows > len(self._has_configured):
            self._has_configured = enlarged(self._has_configured, max(rows, 2 * len(self._has_configured)))

    def _bisected(self, samples: SampleBatch, now_ns: int) -> Iterator[PoseBatch]:
        try:
            poses = self._engine.process(samples)
        except Exception as error:
            rows = samples.rows()
            if len(rows) == 1:
                poses = self._fault(int(rows[0]), samples, error, now_ns)
            else:
                middle = rows[len(rows) // 2]
                yield from self._bisected(samples.selected(lambda row: row < middle), now_ns)
                yield from self._bisected(samples.selected(lambda row: row >= middle), now_ns)
                return
        yield poses

    def _fault(self, row: int, samples: SampleBatch, error: Exception, now_ns: int) -> PoseBatch:
        self._metrics.faults["estimator"].inc()
        self._log.exception(f"estimator of tag {self._sites.rows.at(row).name}", error)
        self.quarantine.note(row, now_ns)
        self._configure(row, start_known=False)
        t_ns = max(int(column["t_ns"].max()) for column in samples.columns() if len(column))
        return PoseBatch(poses=lost_pose(row, t_ns))

    def _configure(self, row: int, start_known: bool = True) -> None:
        current, before = self._current(row), self._configured.get(row)
        self._note(row, current)
        self._has_configured[row] = True
        self._heights.begin(row, start_known)
        if start_known:
            self._starts.tell(row, current.tag, None if before is None else before.tag)
        else:
            self._starts.end(row)
        # After a fault or a restart the tag is no longer where it started.
        told = current if start_known else current.with_start(None)
        self._norths.tell(row, told.tag)
        self._anchor_watch.begin(row)
        self._measured.begin(row, is_known=told.tag.start is not None)
        self._engine.configure(row, told.columns())
        if start_known:
            self._sensors.start(row, current.tag.acc_reversed is not None)
            self._sites.rows.findings.set(row, ())
        self._keep_settings(row, current.columns())
        site = self._sites.of_row(row).index
        others = (other for other in self._configured if other != row and self._sites.of_row(other).index == site)
        self._references.follow(site, row, told.tag, others)

    def _note(self, row: int, current: Configured) -> None:
        self._configured[row] = current
        self._heights.tell(row, current.tag)

    def _keep_settings(self, row: int, settings: Array) -> None:
        if row >= len(self._settings):
            self._settings = enlarged(self._settings, max(row + 1, 2 * len(self._settings)))
        self._settings[row] = settings
        # Not over all rows: a storm of tags would take minutes.
        self._has_units = self._has_units or has_units(settings)

    def _current(self, row: int) -> Configured:
        """Return the settings that its site has now for this row."""
        store = self._sites.of_row(row).store
        tag, site = store.tag_settings(self._sites.rows.at(row).name), store.site
        return Configured(tag, site.declination_rad, site.declination_std_rad)
