"""Requests of the view Settings: what a node is set to, saved, compared, applied, stored; and its program."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from eurobot_od.client import configure
from eurobot_od.client.configure import ChangePlan
from eurobot_od.client.description import read_identity
from eurobot_od.client.master import Master
from eurobot_od.client.program import load
from eurobot_od.device.nmt import NmtCommand
from eurobot_od.errors import ConfigurationError, LocalError, look_up
from eurobot_od.lint.diff import place
from eurobot_od.od.dcf import ChosenCobIds, Dcf, renumbered
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.identity import Identity
from eurobot_od.od.objects import address_of
from eurobot_od.od.values import label
from eurobot_od.support.files import write_whole
from eurobot_od.support.texts import amount
from eurobot_od.web.asking import Arguments, PageRequest, Way, text_of, whole_of
from eurobot_od.web.desk import Desk
from eurobot_od.web.jobs import Job
from eurobot_od.web.views.files import sent_file

HEARTBEAT_WAIT = 1.2
"""Time in s in which a node's heartbeat shows its state; most nodes send one a second."""

COB_IDS = {"": None, "keep": ChosenCobIds.KEEP, "move": ChosenCobIds.MOVE}


class SetNode(NamedTuple):
    """The node of a request, and what describes it."""

    node_id: int
    device: Dictionary


def _target(desk: Desk, said: Arguments) -> SetNode:
    node_id = desk.node_id(text_of(said, "node"))
    device = desk.device(node_id)
    if device is None:
        raise LocalError(f"no file describes node {node_id}: scan, or give its file to the library")
    return SetNode(node_id, device)


def _start(desk: Desk, name: str, title: str, target: SetNode, work: Callable[[Job, Master, SetNode], Any]) -> int:
    """Start a job on a node, with a master; returns its number."""

    def run(job: Job) -> Any:
        with job.master() as master:
            return work(job, master, target)

    return desk.start(name, f"{title} {target.device.name}", run)


# What differs from the file


def begin_differences(desk: Desk, said: Arguments) -> int:
    """Compare a node with its file, as `diff FILE --node` does."""
    return _start(desk, "settings", "the comparison of", _target(desk, said), _differences)


def _differences(job: Job, master: Master, target: SetNode) -> dict[str, Any]:
    found = configure.differences(master.node(target.node_id), target.device, job.progress)
    for each in found:
        what = f"{each.name} ({each.aspect})" if each.aspect != "value" else each.name
        job.row({"object": place(each.where), "name": what, "before": each.left, "after": each.right})
    file = target.device.file.name
    text = f"{amount(len(found), 'difference')} from {file}" if found else f"as {file} says"
    return {"text": text, "heads": ["File", "Node"]}


# Saved, compared and applied


def begin_saving(desk: Desk, said: Arguments) -> int:
    """Save what a node is set to as a DCF, as `dump -o` does."""
    return _start(desk, "settings", "the DCF of", _target(desk, said), partial(_save, desk))


def _save(desk: Desk, job: Job, master: Master, target: SetNode) -> dict[str, Any]:
    name = f"{target.device.name}-{datetime.now():%Y%m%d-%H%M%S}"
    dcf = _dcf(desk, job, master, target, name)
    dcf.write(desk.reports / f"{name}.dcf")
    return {"file": f"{name}.dcf", "text": f"{name}.dcf is saved"}


def _dcf(desk: Desk, job: Job, master: Master, target: SetNode, stem: str) -> Dcf:
    """Read the settings of a node; what it refuses to give is a row."""
    kbit = desk.session.bitrate // 1000
    made = configure.dcf_of_node(master.node(target.node_id), target.device, kbit, stem, job.progress)
    for each in made.left_out:
        where = {"object": label(address_of(each.thing)), "name": each.thing.qualname}
        job.row(where | {"before": "left out", "after": each.refusal})
    return made.dcf


@contextmanager
def _source(desk: Desk, said: Arguments, job: Job, master: Master, target: SetNode) -> Iterator[Dictionary]:
    """Yield the settings that a node is to have: those of a file, or of another node."""
    chosen = look_up("choice for COB-IDs", str(said.get("cob_ids", "")), COB_IDS)
    if "file" in said:
        name, _ = sent_file(desk, said)
        with TemporaryDirectory(prefix="eurobot-od-") as folder:  # the files of its DOMAINs were sent, too
            for each, content in desk.uploads[said["who"]].items():
                write_whole(Path(folder, each), bytes(content))
            yield renumbered(Dictionary.load(Path(folder, name), target.node_id), target.node_id, chosen)
        return
    other = _target(desk, {**said, "node": text_of(said, "from")})
    with TemporaryDirectory(prefix="eurobot-od-") as folder:  # a DOMAIN stands beside the DCF
        file = Path(folder, f"{other.device.name}.dcf")
        _dcf(desk, job, master, other, file.stem).write(file)
        yield renumbered(Dictionary.load(file, target.node_id), target.node_id, chosen)


def begin_preview(desk: Desk, said: Arguments) -> int:
    """Compare a node with a DCF, or with another node, as `configure --dry-run` does."""
    return _start(desk, "settings", "the comparison of", _target(desk, said), partial(_preview, desk, said))


def _preview(desk: Desk, said: Arguments, job: Job, master: Master, target: SetNode) -> dict[str, Any]:
    with _source(desk, said, job, master, target) as wanted:
        plan = configure.difference(master.node(target.node_id), wanted, progress=job.progress)
        desk.previewed = plan
        for each in plan.changes:
            before, after = each.texts
            job.row(
                {"object": label(address_of(each.thing)), "name": each.thing.qualname}
                | {"before": before, "after": after}
            )
    return {"text": plan.heading, "changes": len(plan.changes)}


def begin_applying(desk: Desk, said: Arguments) -> int:
    """Write what the last preview has shown, as `configure` does; a node that has changed since is left alone."""
    target = _target(desk, said)
    shown = desk.previewed
    if shown is None or shown.dictionary.node_id != target.node_id or not shown.changes:
        raise LocalError("compare first: what is written is what the comparison has shown")
    reasons = (desk.guard.of_object(target.node_id, address_of(each.thing)) for each in shown.changes)
    reset = desk.guard.of_nmt(NmtCommand.RESET_NODE, target.node_id)
    desk.confirm(said, next(filter(None, reasons), "") or reset)
    return _start(desk, "settings", "the configuration of", target, partial(_apply, desk, said, shown))


def _apply(desk: Desk, said: Arguments, shown: ChangePlan, job: Job, master: Master, target: SetNode) -> dict[str, Any]:
    node = master.node(target.node_id)
    with _source(desk, said, job, master, target) as wanted:
        plan = configure.difference(node, wanted, progress=job.progress)
        if [each[1:] for each in plan.changes] != [each[1:] for each in shown.changes]:
            raise ConfigurationError("the node has changed since it was compared: compare again", (), ())
        node.state(HEARTBEAT_WAIT)  # before the reset, as `apply` brings the node back to the state seen last
        outcome = configure.apply(node, plan, datetime.now(), stores=said.get("store") is not False)
    desk.previewed = None
    return {"text": outcome.text(target.node_id, said.get("store") is not False)}


# Stored and restored


def begin_storing(desk: Desk, said: Arguments) -> int:
    """Order a node to store its parameters, as `store` does."""
    return _start(desk, "settings", "the storing of", _target(desk, said), _store)


def _store(_: Job, master: Master, target: SetNode) -> dict[str, Any]:
    configure.store(master.node(target.node_id))
    return {"text": f"node {target.node_id} has stored all parameters"}


def begin_restoring(desk: Desk, said: Arguments) -> int:
    """Order a node to restore its defaults, and reset it, as `restore --reset` does."""
    target = _target(desk, said)
    desk.confirm(said, desk.guard.of_nmt(NmtCommand.RESET_NODE, target.node_id))
    return _start(desk, "settings", "the restoring of", target, _restore)


def _restore(_: Job, master: Master, target: SetNode) -> dict[str, Any]:
    configure.restore_and_reset(master.node(target.node_id), target.device.restored_node_id)
    return {"text": f"node {target.node_id} has the defaults of all parameters"}


# The program


def begin_program(desk: Desk, said: Arguments) -> int:
    """Download a program into a node, as `program` does."""
    target = _target(desk, said)
    number = whole_of(said, "number")
    name, content = sent_file(desk, said)
    if not content:
        raise LocalError(f"{name}: the file is empty")
    procedure = desk.equipment.procedure(Identity.of(target.device), content, said.get("force") is True)
    desk.confirm(said, f"{target.device.name} is stopped for {name}: what hangs on it is left to itself")

    def download(job: Job, master: Master, target: SetNode) -> dict[str, Any]:
        node = master.node(target.node_id)
        job.row({"object": "before", "name": str(read_identity(node)), "before": "", "after": ""})
        loaded = load(node, content, number, said.get("crc") is not False, job.progress, target.device, procedure)
        job.row({"object": "after", "name": str(read_identity(node)), "before": "", "after": ""})
        return {"text": f"node {target.node_id}: program {number}: {loaded.text}"}

    return _start(desk, "program", "the program of", target, download)


REQUESTS = {
    "differences": PageRequest(begin_differences, Way.AT_ONCE),
    "save": PageRequest(begin_saving, Way.AT_ONCE, acts=True),
    "preview": PageRequest(begin_preview, Way.AT_ONCE, acts=True),
    "apply": PageRequest(begin_applying, Way.AT_ONCE, acts=True),
    "store": PageRequest(begin_storing, Way.AT_ONCE, acts=True),
    "restore": PageRequest(begin_restoring, Way.AT_ONCE, acts=True),
    "program": PageRequest(begin_program, Way.AT_ONCE, acts=True),
}
