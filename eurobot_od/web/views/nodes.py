"""Requests of the view Nodes: a scan, LSS, and the errors that a node remembers."""

from __future__ import annotations

from functools import partial
from typing import Any

from eurobot_od.client import lss
from eurobot_od.client.description import Found, addressed, check_free, scan
from eurobot_od.client.lss import perform
from eurobot_od.client.streams import read_history
from eurobot_od.errors import LocalError
from eurobot_od.od.identity import Identity, misfit
from eurobot_od.od.standard import LssState
from eurobot_od.web.asking import Arguments, PageRequest, Way
from eurobot_od.web.desk import Desk
from eurobot_od.web.jobs import Job


def begin_scan(desk: Desk, _: Arguments) -> int:
    """Scan the bus for all nodes, as `scan` does."""
    return desk.start("scan", "the scan", partial(_scan, desk))


def _scan(desk: Desk, job: Job) -> dict[str, Any]:
    with job.master() as master:
        found = scan(master, progress=job.progress, tell=lambda each: job.row(each.as_data() | _file_of(desk, each)))
    there = {each.node_id for each in found}
    known = desk.session.decoder.dictionaries
    return {"missing": [f"{each.name} ({each.node_id})" for each in known if each.node_id not in there]}


def _file_of(desk: Desk, found: Found) -> dict[str, Any]:
    """Return the file of a node that was found, and what is to be said about it."""
    known = desk.device(found.node_id)
    if found.identity is None:
        return {"file": known.file.name if known else "", "further": ""}
    if known is not None:
        other = misfit(known, found.identity, found.device_type)
        return {"file": known.file.name, "further": f"is for another device: this one has {other}" if other else ""}
    fit = desk.equipment.library.find(found.identity, found.device_type)
    return {"file": fit.entry.path.name if fit else "", "further": fit.further if fit else ""}


def errors(desk: Desk, said: Arguments) -> dict[str, Any]:
    """Read the errors that a node remembers, newest first, as `emcy` prints them."""
    node = desk.node(said)
    words_of = desk.session.decoder.errors.of
    found = read_history(node)
    return {"register": found.register, "lines": list(found.lines(node.node_id, words_of(node.node_id)))}


# LSS


def find_lss(desk: Desk, _: Arguments) -> int:
    """Find the devices without a node-ID, as `lss find` does."""
    return desk.start("lss", "the search by LSS", partial(_find_lss, desk))


def _find_lss(desk: Desk, job: Job) -> None:
    for each in _performed(job, lss.find_all()):
        fit = desk.equipment.library.find(each)
        job.row({"identity": list(each), "text": str(each), "file": fit.entry.path.name if fit else ""})


def set_lss(desk: Desk, said: Arguments) -> int:
    """Set node-ID and bit rate of a device without a node-ID, as `lss set` does."""
    node_id, rate, delay = (_number(said, each) for each in ("node-ID", "bit rate", "activate"))
    store = said.get("store") is True
    wanted = lss.settings(node_id, rate, store, None if delay is None else delay / 1000)
    if not wanted:
        raise LocalError("nothing to set: give a node-ID, a bit rate, or have it stored")
    numbers = said.get("identity")
    if not isinstance(numbers, list) or len(numbers) != IDENTITY_NUMBERS or not all(map(_is_number, numbers)):
        raise LocalError("identity is missing, or not four numbers of 32 bits")
    identity = Identity(*numbers)
    address = desk.equipment.address(identity)

    def by_lss(job: Job) -> str:
        with job.master() as master:
            check_free(master, node_id, identity)
        return _performed(job, lss.set_up(identity, False, wanted))

    if address is None:
        return desk.start("lss set", "LSS", by_lss)

    def by_maker(job: Job) -> list[str]:
        with job.master() as master:
            return [addressed(master, address, identity, node_id, bit_rate=rate, store=store, activate=delay)]

    return desk.start("lss set", "the maker's procedure", by_maker)


IDENTITY_NUMBERS = 4


def _is_number(value: object) -> bool:
    return isinstance(value, int) and 0 <= value < 1 << 32


def _number(said: Arguments, name: str) -> int | None:
    value = said.get(name)
    if value is not None and (not isinstance(value, int) or isinstance(value, bool)):
        raise LocalError(f"{name} is not a whole number")
    return value


def _performed(job: Job, steps: lss.LssSteps[lss.Result]) -> lss.Result:
    with job.master() as master:
        try:
            return perform(master, steps, progress=job.progress)
        finally:
            # A device left in configuration state would obey the next command, whichever device that is for.
            perform(master, lss.switch(LssState.WAITING))


REQUESTS = {
    "scan": PageRequest(begin_scan, Way.AT_ONCE),
    "errors": PageRequest(errors),
    "find lss": PageRequest(find_lss, Way.AT_ONCE, acts=True),
    "set lss": PageRequest(set_lss, Way.AT_ONCE, acts=True),
}
