"""Two dialects on one bus: the core notices it at the node check, before anything moves, and names it."""

from __future__ import annotations

from pathlib import Path

import pytest

from eurobot_od.bus.simulated.loop import run
from eurobot_od.bus.simulated.network import Simulation
from eurobot_od.frame import Frame
from eurobot_od.od.standard import REVISION
from eurobot_od.robot import dialects
from eurobot_od.robot.nodes import Core, Drive, Navigation, Node
from eurobot_od.robot.nodes.core.agreement import QUESTIONS, NodeMismatch, number_in

BOOTED = 0.1
ONE, OTHER = dialects.names()[:2]
ROLES: dict[str, type[Node]] = {"core": Core, "drive": Drive, "navigation": Navigation}


def robot(**spoken: str) -> tuple[Simulation, Core]:
    """Put the three nodes on a bus, each in the dialect given, and let them boot."""
    network = Simulation()
    nodes = {name: role(dialects.load(name, spoken.get(name, ONE))) for name, role in ROLES.items()}
    for node in nodes.values():
        network.attach(node)
    network.run(BOOTED)
    core = nodes["core"]
    assert isinstance(core, Core)
    return network, core


def check(network: Simulation, core: Core) -> dict[str, float]:
    async def main() -> dict[str, float]:
        return await core.check_nodes()

    return run(network, main())


@pytest.mark.parametrize("dialect", dialects.names())
def test_nodes_of_one_dialect_are_fine(dialect: str) -> None:
    assert set(check(*robot(core=dialect, drive=dialect, navigation=dialect))) == {"drive", "navigation"}


@pytest.mark.parametrize(
    ("spoken", "text"),
    [
        ({"drive": OTHER}, f"drive (node 2) maps messages differently: .* dialect {OTHER})"),
        ({"navigation": OTHER}, f"navigation (node 3) maps messages differently: .* dialect {OTHER})"),
        ({"core": OTHER}, f"drive (node 2) maps messages differently: .* dialect {ONE})"),
    ],
)
def test_another_dialect_is_noticed_and_named(spoken: dict[str, str], text: str) -> None:
    pattern = text.replace("(", r"\(").replace(")", r"\)")
    with pytest.raises(NodeMismatch, match=pattern):
        check(*robot(**spoken))


def test_the_error_names_dialects_when_it_is_printed_and_the_node_reads_no_file(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    network, core = robot(drive=OTHER)
    with monkeypatch.context() as without_files:
        without_files.setattr(dialects, "eds_folder", lambda: tmp_path / "none")
        with pytest.raises(NodeMismatch) as caught:
            check(network, core)
    assert OTHER in str(caught.value)


def test_a_number_of_no_dialect_names_none() -> None:
    text = str(NodeMismatch("drive", 2, "maps messages differently", 0xABCD))
    assert text == "drive (node 2) maps messages differently; nothing is driven"


@pytest.mark.parametrize(("dialect", "is_believed"), [("canopen", False), ("firmware2014", True)])
def test_a_node_without_sdo_is_believed_in_the_dialect_of_2014_only(dialect: str, is_believed: bool) -> None:
    network, core = robot(core=dialect, drive=dialect, navigation=dialect)
    core.device.objects.put((0x1280, 1), 0x67F)  # nobody answers there
    begin = network.now
    if is_believed:
        assert set(check(network, core)) == {"drive", "navigation"}
    else:
        with pytest.raises(NodeMismatch, match="answers no SDO, so nobody knows how it maps"):
            check(network, core)
    # One that may have no SDO is asked once: the startup has its times.
    attempts = 1 if is_believed else QUESTIONS
    assert network.now - begin == pytest.approx(attempts * core.identity_wait, abs=0.01)


@pytest.mark.parametrize(
    ("data", "revision"),
    [
        ("4318100300000200", 0x00020000),
        ("8018100311000906", None),  # an abort
        ("4318100200000200", None),  # another object
        ("4118100304000000", None),  # not expedited
        ("431810", None),  # too short
    ],
)
def test_the_revision_in_an_answer(data: str, revision: int | None) -> None:
    assert number_in(Frame(0x582, bytes.fromhex(data)), REVISION) == revision
