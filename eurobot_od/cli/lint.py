"""Commands that check and compare device files (EDS, DCF, XDD, XDC): `lint` and `diff`."""

from __future__ import annotations

import gc
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, NamedTuple, TypeAlias

from eurobot_od import loading
from eurobot_od.cli import ExitStatus, RobotName, complain, log_instead
from eurobot_od.cli.options import BusOptions, Json, OneDevice, give
from eurobot_od.cli.signature import Option
from eurobot_od.errors import DictionaryError, FileError, LocalError, UnknownName, look_up
from eurobot_od.lint.findings import Finding, Rule, Severity, chosen, count, sarif, summary, summed_up
from eurobot_od.lint.model import load
from eurobot_od.lint.rules import FILE_RULES, lint_device
from eurobot_od.od import DEFAULT
from eurobot_od.od.document import SECTION_NAMES, read_bytes
from eurobot_od.od.formats import SUFFIXES, files_in, foreign_network, is_xml
from eurobot_od.od.values import check_node_id
from eurobot_od.support.progress import OBJECTS, bar
from eurobot_od.support.texts import one_line

if TYPE_CHECKING:
    from eurobot_od.lint.diff import EdsDifference
    from eurobot_od.lint.network import LintedNetwork
    from eurobot_od.plugin import Plugin


def _prefixes(text: str) -> tuple[str, ...]:
    """Parse prefixes of rules' codes."""
    return tuple(each.strip().upper() for each in text.split(",") if each.strip())


def _rules(_: Plugin | None = None) -> Mapping[str, Rule]:
    """Return all rules, by code."""
    from eurobot_od.lint.network import RULES  # here, as most checks do not need it
    from eurobot_od.lint.stack_rules import STACKS

    of_stacks = (each for rules in STACKS.values() for each in rules)
    return {each.code: each for each in (*FILE_RULES, *RULES, *of_stacks)}


Codes: TypeAlias = Annotated[tuple[str, ...], Option(metavar="CODES", read=_prefixes)]


@dataclass(frozen=True, kw_only=True)
class LintReport:
    """Which findings are reported, and how.

    as_json: write one JSON object instead of lines
    format: write a SARIF log, for the code scanning of GitHub and others
    select: only rules whose codes start like this, such as E6,W447
    ignore: no rules whose codes start like this, such as I
    verbose: print every finding: infos and repeated ones, too
    strict: warnings count as errors
    """

    as_json: Annotated[Json, Option(either="form")] = False
    format: Annotated[Literal["sarif"] | None, Option(either="form")] = None
    select: Codes = ()
    ignore: Codes = ()
    verbose: Annotated[bool, Option("-v")] = False
    strict: bool = False

    def check(self) -> None:
        """Check that each prefix fits a rule's code; raises LocalError."""
        prefixes = (*self.select, *self.ignore)
        rules = _rules() if prefixes else {}
        for prefix in prefixes:
            if prefix.isalpha() and len(prefix) > 1:  # a word, in capitals here
                raise LocalError(f"{prefix} begins no rule's code: write E for errors, W for warnings, or such as W447")
            if not any(code.startswith(prefix) for code in rules):
                raise UnknownName("rule", prefix, rules)

    def give(self, findings: Sequence[Finding], number: int, identifiers: Sequence[tuple[str, ...]]) -> ExitStatus:
        """Print the findings of `number` files, with a network's COB-IDs; return the exit status."""
        wanted = chosen(findings, self.select, self.ignore)
        data = _as_data(wanted, identifiers) if self.as_json else None
        if number and self.format:
            # GitHub refuses a SARIF log of more than 25 000 results.
            data = sarif(wanted if self.verbose else summed_up(wanted), tuple(_rules().values()))
        lines = _lines(wanted, number, identifiers, self.verbose, bool(self.verbose or self.select)) if number else ()
        give(data is not None, data, lines, indent=1)
        counted = (Severity.ERROR, Severity.WARNING) if self.strict else (Severity.ERROR,)
        return ExitStatus.FOUND if any(count(wanted, each) for each in counted) else ExitStatus.FINE


def lint(
    files: Annotated[Sequence[str], Option(metavar="FILE", is_file=True)] = (),
    *,
    network: bool = False,
    report: LintReport,
    device: OneDevice,
    stack: Annotated[Literal["canopennode"] | None, Option("--for")] = None,
    fix: bool = False,
    output: Annotated[str | None, Option("-o", metavar="FILE", is_file=True, is_output=True)] = None,
    explain: Annotated[str | None, Option(metavar="CODE", suggest=_rules)] = None,
    robot_name: RobotName = None,
) -> ExitStatus:
    """Check EDS, DCF, XDD and XDC files or folders of them, each alone, and together as a network.

    Exit status 0 nothing found, 1 something found (errors; with --strict warnings too), 2 a file that cannot be read.

    files: EDS, DCF, XDD, XDC or a folder; with --network also a network file (default: eurobot-od.yaml in this
        folder); left out: those of the --robot
    network: check the files also together, as the nodes of one network
    stack: check also what this stack asks of the object dictionary that it is compiled with
    fix: rewrite the files in the normal form that every tool reads, and list the changes
    output: with --fix: the file to write (default: the same file)
    explain: print what a rule demands, and its source

    $ lint motor.eds
    $ lint --fix motor.eds -o better.eds
    $ lint --robot mine
    """
    report.check()
    if explain:
        print(explanation(explain.upper()))
        return ExitStatus.FINE
    robot = None if files else loading.named(robot_name)
    files = files or _of_robot(robot, network) or _here(network)
    if not files:
        raise LocalError("no files to check: name EDS, DCF or XDD files, folders of them, or a --robot")
    if network or fix:
        device.refuse("a network file says them itself, and `export eds` writes the file with both")
    if output and not fix:
        raise LocalError(f"-o {output} goes with --fix only: without it nothing is written")
    if fix:  # files only, so that no folder is rewritten by mistake
        return _fix(files, output)
    unreadable: list[DictionaryError] = []
    checks = FileChecks(stack or "", device, unreadable)
    if not network:
        expanded: list[str | Path] = []
        for path in files:
            expanded += files_in(path) if Path(path).is_dir() else [path]
        files = [str(file) for file in expanded]
    status = report.give(*_found(files, network, checks))
    for each in unreadable:
        complain(str(each))
    if unreadable:
        return ExitStatus.WRONG_INPUT
    return ExitStatus.FOUND if robot and differs_from_table(robot) else status


def differs_from_table(robot: Plugin) -> bool:
    """Report that EDS files of a robot are not what its table makes; return whether they differ."""
    from eurobot_od.od.make import read_table
    from eurobot_od.od.make.text import differences, make_files

    table, folder = robot.table, robot.dialects.root
    if table is None or folder is None or not table.is_file():
        return False
    made = make_files(read_table(table.read_text(encoding="utf-8", errors="replace"), table, loading.table_of))
    found = differences(made, folder)
    if found:
        complain(f"{found[0]}: not what {table} makes; `make-eds {table} -o {folder}` writes it anew")
    return bool(found)


def _of_robot(robot: Plugin | None, as_network: bool) -> list[str]:
    """Return the files of a robot: the EDS files of all its dialects, or its network file."""
    if robot is None:
        return []
    network = robot.dialects.network_file()
    if as_network and network:
        return [str(network)]
    return [str(robot.dialects.folder(each)) for each in robot.dialects.names()]


def _here(as_network: bool) -> list[str]:
    """Return the network file of this folder if a network is to be checked."""
    return [DEFAULT] if as_network and Path(DEFAULT).is_file() else []


class FileChecks(NamedTuple):
    """How each file is checked: the stack, modules and patches; `unreadable` collects errors of files."""

    stack: str
    over: OneDevice
    unreadable: list[DictionaryError]

    def findings(self, file: str) -> list[Finding]:
        """Check a file; raises DictionaryError if it is no device file."""
        data = read_bytes(file)
        if not data:
            raise DictionaryError(file, None, "the file is empty")
        device = load(data, file, self.over.patch, self.over.module)
        if not device.objects and (network := foreign_network(data)):
            raise DictionaryError(file, None, network)
        is_named = file.lower().endswith(SUFFIXES)  # for these, missing sections are findings
        if not (is_named or device.objects or device.document.sections.keys() & SECTION_NAMES.keys()):
            from eurobot_od.od.network import is_network  # imports dictionaries, which a check does without

            checked_by = f"check {file}" if SUITE.search(data) else f"lint --network {file}"
            hint = f"it is checked by {checked_by}" if is_network(file) else ""
            what = "not an EDS: it has no section of one"
            raise DictionaryError(file, None, "; ".join(filter(None, [what, hint or log_instead(file)])))
        return lint_device(device, file, self.stack)


def _found(
    files: Sequence[str], as_network: bool, checks: FileChecks
) -> tuple[list[Finding], int, Sequence[tuple[str, ...]]]:
    """Check files, one by one or as a network; return the findings, the number of files, and the COB-IDs."""
    gc.disable()  # a check drops no objects, and garbage collection would take a third of its time
    try:
        if as_network:
            from eurobot_od.lint.network import lint_network, overview

            linted = read_network(files)
            of_files = [each for node in linted.nodes for each in lint_device(node.device, node.file, checks.stack)]
            order = {each.file: number for number, each in enumerate(linted.nodes)}
            found = sorted({*lint_network(linted), *of_files}, key=lambda each: (order[each.file], *each[1:]))
            return found, len(linted.nodes), overview(linted)
        counted: Iterable[str] = files
        if len(files) > 1:
            from eurobot_od.support import progress

            counted = progress.counted(files, len(files), "files", at_once=1)
        findings: list[Finding] = []
        for file in counted:
            try:
                findings += checks.findings(file)
            except DictionaryError as error:  # the other files are still checked
                checks.unreadable.append(error)
        return findings, len(files) - len(checks.unreadable), ()
    finally:
        gc.enable()


def _fix(files: Sequence[str], output: str | None) -> ExitStatus:
    """Write files in their normal form, leaving out what cannot be read."""
    from eurobot_od.od.normal import in_normal_form
    from eurobot_od.support.files import write_whole

    if output and len(files) > 1:
        raise LocalError("-o is for one file")
    for file in files:
        before = read_bytes(file)
        if output is None and is_xml(before):
            raise LocalError(f"{file} is a device description in XML; -o FILE.eds writes the EDS that says the same")
        data, changes = in_normal_form(before, file)  # raises before anything is written
        for line, what, *_ in changes:
            print(one_line(f"{file}:{line}: {what}"))
        if data != before and not changes:
            print(one_line(f"{file}: {_difference(before, data)}"))
        if data != before or output:
            write_whole(Path(output or file), data)
    return ExitStatus.FINE


SUITE = re.compile(rb"^spec:", re.MULTILINE)
"""The key that only suites have."""

SECTION = re.compile(rb"^\[([^\]\r\n]+)\]", re.MULTILINE)


def _difference(before: bytes, after: bytes) -> str:
    """Return how the normal form differs from a file without mistakes."""
    old = {each.lower() for each in SECTION.findall(before)}
    added = [f"[{each.decode()}]" for each in SECTION.findall(after) if each.lower() not in old]
    return f"added: {', '.join(added)}" if added else "only order and spelling changed"


def read_network(files: Sequence[str]) -> LintedNetwork:
    """Read a network: a network file, a folder, or the nodes' EDS and DCF files; raises FileError."""
    from eurobot_od.lint.network import LintedNetwork, NetworkNode, nodes_of
    from eurobot_od.od.network import NetworkFile, NodeFile, read_network

    is_network = len(files) == 1 and not files[0].lower().endswith(SUFFIXES)
    described = read_network(files[0]) if is_network else NetworkFile([NodeFile(each) for each in files])
    for each in described.nodes:
        if not each.file:
            raise FileError(files[0], f"node {each.name} names no file, and lint asks no library")
    devices = []
    for each in described.nodes:
        with each.told():
            devices.append((each, load(read_bytes(each.file), each.file, each.patch, each.modules)))
    members = [
        NetworkNode(each.name or device.name.rpartition(".")[0], each.file, device, each.node_id or 0)
        for each, device in devices
    ]
    return LintedNetwork(nodes_of(members), described.shared, described.order, described.bit_rate, described.master)


def explanation(code: str) -> str:
    """Return a rule's demand, severity and source; raises UnknownName."""
    rule = look_up("rule", code, _rules())
    return f"{rule.code} ({rule.severity.name.lower()}): {rule.demand}\nSource: {rule.clause}"


def _lines(
    findings: Sequence[Finding], files: int, identifiers: Sequence[tuple[str, ...]], verbose: bool, infos: bool
) -> Iterator[str]:
    for identifier, name, producers, consumers in identifiers:
        yield one_line(f"{identifier}  {name:32}  {producers or '-':24}  -> {consumers or '-'}")
    shown = [each for each in findings if infos or each.severity is not Severity.INFO]
    yield from map(str, shown if verbose else summed_up(shown))
    yield summary(findings, files, not infos)


def _as_data(findings: Sequence[Finding], identifiers: Sequence[tuple[str, ...]]) -> dict[str, Any]:
    data: dict[str, Any] = {
        "findings": [{**each._asdict(), "severity": each.severity.name.lower()} for each in findings],
        "counts": {each.name.lower(): count(findings, each) for each in Severity},
    }
    if identifiers:
        data["identifiers"] = [
            {"identifier": identifier, "name": name, "producers": _split(producers), "consumers": _split(consumers)}
            for identifier, name, producers, consumers in identifiers
        ]
    return data


def _split(joined: str) -> list[str]:
    return joined.split(", ") if joined else []


def diff(
    left: Annotated[str, Option(metavar="A", is_file=True)],
    right: Annotated[str | None, Option(metavar="B", is_file=True)] = None,
    *,
    node: Annotated[int | None, Option(metavar="ID")] = None,
    names: bool = False,
    as_json: Json = False,
    bus: BusOptions,
) -> ExitStatus:
    """Compare two EDS, DCF, XDD or XDC files, or one with a live node.

    Exit status 0 no difference, 1 differences or a node that does not answer, 2 a file that cannot be read, 3 bus
    trouble.

    left: an EDS, DCF, XDD or XDC
    right: the file to compare it with
    node: node-ID: of the live node, or to fill in for $NODEID
    names: compare the ParameterNames too
    as_json: write a JSON list instead of lines

    $ diff motor.eds drive.eds
    $ diff motor.eds --node 5 -i socketcan -c can0
    """
    from eurobot_od.lint.diff import compare, place, read_device

    if node is not None:
        check_node_id(node)
    if right and (bus.interface or bus.channel):
        raise LocalError(f"two files, or a file and a live node: leave out -i and -c, or {right}")
    device = read_device(left)
    if right:
        found = compare(device, read_device(right), node, names)
    else:
        node_id = node or device.node_id  # a DCF has a node-ID, an EDS has none
        if node_id is None:
            raise LocalError("nothing to compare with: name a second file, or a live node with --node")
        found = _live(bus, left, node_id)
    give(as_json, ({**each._asdict(), "where": place(each.where)} for each in found), map(str, found), indent=1)
    return ExitStatus.FOUND if found else ExitStatus.FINE


def _live(bus: BusOptions, file: str, node_id: int) -> list[EdsDifference]:
    """Compare a file with a live node; raises LocalError, BusError, NoAnswer."""
    from eurobot_od.client.configure import differences
    from eurobot_od.client.master import Master  # two files are compared without a bus
    from eurobot_od.od.dictionary import Dictionary

    with Master(bus.open()) as master, bar(f"node {node_id}", unit=OBJECTS, late=True) as progress:
        dictionary = Dictionary.load(file, node_id)
        master.follow(dictionary)
        return differences(master.node(node_id), dictionary, progress)
