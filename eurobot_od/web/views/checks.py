"""Requests of the view Checks: suites that are made from a device's file, or written, are run on the bus."""

from __future__ import annotations

import datetime
import json
from collections.abc import Sequence
from math import inf
from pathlib import Path
from typing import Any

from eurobot_od.check import page, report
from eurobot_od.check.conformance import page as ctt
from eurobot_od.check.conformance.clauses import Tier
from eurobot_od.check.conformance.suite import MadeSuites, parse_motion
from eurobot_od.check.format import SuiteReader
from eurobot_od.check.recorded import suite_of
from eurobot_od.check.report import RunFacts, StepResult, SuiteResult
from eurobot_od.check.runner import Interrupt
from eurobot_od.check.runs import OnBus, compared, identified, number_of_steps, results_of
from eurobot_od.check.suite import Suite
from eurobot_od.errors import LocalError, look_up
from eurobot_od.export.forms import html_of
from eurobot_od.od import cia401, cia402
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.pdos import unheard
from eurobot_od.support.files import write_whole
from eurobot_od.support.texts import encodable
from eurobot_od.traffic import formats
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of
from eurobot_od.web.desk import Desk
from eurobot_od.web.jobs import Job

TIERS = {each.value: each for each in Tier}

PROFILES = {"CiA 301": None, "CiA 401": cia401.PROFILE, "CiA 402": cia402.PROFILE}
"""Suites that are made from a device's file, by the standard that they are about."""

BUS = Path("bus")
"""What suites call the devices of the page."""

SUITE_FILES = ("*.yaml", "*.yml")


def suites_here(desk: Desk, _: Arguments) -> list[str]:
    """Return the files of suites that lie in the folder of the page."""
    return sorted(each.name for pattern in SUITE_FILES for each in (desk.folder / "suites").glob(pattern))


def suite_of_recording(desk: Desk, said: Arguments) -> str:
    """Make the last recording, or a part of it, a suite of a node, as `export suite` does; return its file's name."""
    log = desk.session.recording.finished
    node = text_of(said, "node")
    begin = said.get("from") or 0.0
    end = said.get("to") or inf
    if not isinstance(begin, int | float) or not isinstance(end, int | float) or not 0 <= begin < end:
        raise LocalError("from and to are times in s, the first one before the second")
    with log.open("rb") as file:
        logged = (each[1:] for each in formats.entries(file))
        text = suite_of(desk.session.decoder, node, logged, f"{node} as recorded", begin, end)
    target = desk.folder / "suites" / f"{node}-{log.stem}.yaml"
    target.parent.mkdir(exist_ok=True)
    write_whole(target, encodable(text).encode())
    return target.name


def begin_check(desk: Desk, said: Arguments) -> int:
    """Run suites, as `check` does, and keep the reports."""
    device = desk.device(desk.node_id(text_of(said, "node")))
    if device is None:
        raise LocalError("no file describes this node, so nothing is known that could be checked")
    steps = [each for each in (said.get("steps"),) if isinstance(each, str) and each]
    made, texts, reason = _wanted(desk, said, device)
    desk.confirm(said, reason)
    suites = _reader(desk).read_texts(texts)
    work = _Check(desk, device, made, suites, steps).run
    return desk.start("check", f"the check of {device.name}", work)


def _wanted(desk: Desk, said: Arguments, device: Dictionary) -> tuple[MadeSuites | None, dict[Path, str | None], str]:
    """Return what suites are made, their texts, and why they may move something."""
    name = text_of(said, "suites")
    if name in PROFILES:
        tier = look_up("tier", text_of(said, "tier"), TIERS)
        motion = parse_motion(text_of(said, "motion")) if said.get("motion") else None
        made = MadeSuites(PROFILES[name], tier, motion, said.get("outputs") is True)
        return made, dict(made.texts([device])), _why(made, device.name)
    file = look_up("suite", name, {each: desk.folder / "suites" / each for each in suites_here(desk, {})})
    return None, {file: None}, f"{name} sends to {device.name} what it says: what hangs on it may move"


def _why(made: MadeSuites, device: str) -> str:
    """Return why generated suites may move something, empty if they only read."""
    reasons = []
    if made.motion is not None:
        reasons.append("it moves the motor of {}, up to {} at {} in the drive's units".format(device, *made.motion))
    if made.outputs:
        reasons.append(f"it switches the outputs of {device}")
    if made.tier is not Tier.READING:
        does = "resets and starts" if made.tier is Tier.REVERSIBLE else "resets, starts and stores in"
        reasons.append(f"it {does} {device}, and writes to it: what hangs on it may move")
    return "; ".join(reasons)


def _reader(desk: Desk) -> SuiteReader:
    """Return the reader of suites for the devices of the bus; a suite that names a dialect is for that."""
    known = desk.equipment.networks
    networks = known._replace(
        find=lambda dialect: known.find(dialect) if dialect else BUS,
        load=lambda path: desk.session.decoder.dictionaries if path == BUS else known.load(path),
        refused=unheard,
    )
    return SuiteReader(networks)


class _Check:
    """One run: what it tells as it goes on, and its reports."""

    def __init__(
        self, desk: Desk, device: Dictionary, made: MadeSuites | None, suites: Sequence[Suite], steps: Sequence[str]
    ) -> None:
        self._desk = desk
        self._device = device
        self._made = made
        self._suites = suites
        self._steps = steps
        self._total = sum(map(number_of_steps, suites))
        self._done = 0

    def run(self, job: Job) -> dict[str, Any]:
        """Run the suites; returns the summary, the reports, and how the run differs from the last one."""
        self._job = job
        interrupt = Interrupt()
        job.at_end = interrupt.request
        self._began = datetime.datetime.now().astimezone().isoformat("T", "seconds")
        with job.master() as master:
            self._devices = identified(master, [self._device])
        how = OnBus(job.open, self._made is not None, self._steps, self._desk.equipment.bus)
        results = [*results_of(how, self._suites, [1], interrupt, self)]
        doubts = [each.doubt for each in self._devices if each.doubt]
        notes = [*doubts, *report.changed(results), *report.remarks(results), *report.not_run(results)]
        return {"summary": report.summary(results, self._facts), "notes": notes} | self._kept(results)

    # What hears of the run (`runs.RunListener`)

    def heading(self, suite: Suite, how: str) -> None:
        """Enter that a suite begins."""
        self._job.row({"suite": report.heading(suite, how)})

    def step(self, step: StepResult) -> None:
        """Enter a step, with its reason and its last frames."""
        lines = list(report.reason_lines(step.reason)) if step.reason is not None else []
        self._done += 1
        self._job.progress(self._done, max(self._total, self._done))
        self._job.row({"step": step.name, "status": step.status.value, "seconds": round(step.seconds, 4), "why": lines})

    def end(self, result: SuiteResult) -> None:
        """Do nothing: the page counts the steps."""

    # Reports

    @property
    def _facts(self) -> RunFacts:
        return RunFacts(self._desk.equipment.made_by, self._began, self._desk.equipment.bus, self._devices)

    def _kept(self, results: Sequence[SuiteResult]) -> dict[str, Any]:
        """Write the reports, and return their names, and what has changed since the last run of the same suites."""
        what = "suites" if self._made is None else f"cia{self._made.profile or 301}"
        stem = f"{self._device.name}-{what}"
        now = datetime.datetime.now()
        data = report.as_data(results)
        facts = self._facts
        before = sorted(self._desk.reports.glob(f"{stem}-*.json"))
        changes = compared(json.loads(before[-1].read_text("utf-8")), data) if before else []
        texts = {"json": json.dumps(data, indent=1), "xml": report.junit(results, facts)}
        blocks = page.blocks(results, facts)
        if self._made is not None and self._made.profile is None:
            (run,) = self._made.device_runs(results, facts)
            blocks = ctt.blocks(run)
            texts["txt"] = "\n".join([self._device.name, *ctt.lines(run.tests), ""])
        texts["html"] = html_of(list(blocks))
        files = [Path(f"{stem}-{now:%Y%m%d-%H%M%S}.{suffix}") for suffix in texts]
        for file, text in zip(files, texts.values()):
            write_whole(self._desk.reports / file, encodable(text).encode())
        return {"files": [each.name for each in files], "before": before[-1].stem if before else "", "changes": changes}


REQUESTS = {
    "suites": PageRequest(suites_here, Way.AT_ONCE),
    "suite of recording": PageRequest(suite_of_recording, Way.SENDS, acts=True),
    "check": PageRequest(begin_check, Way.AT_ONCE, acts=True),
}
