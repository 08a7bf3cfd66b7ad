"""The shipped suites: green without a fault, red at the named step with one, and complete.

The whole matrix of faults and suites is `tools/fault_matrix.py`'s; here is a sample of it.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product

import fault_matrix
import pytest
from fault_matrix import Run

from eurobot_od.check.suite import Suite
from eurobot_od.robot import dialects
from tests.robot.faults import PLUGINS
from tests.rows import rows

SENTENCES = (
    # 2.1 GoTo-Protokoll
    ("bestätigt das Empfangen des zuvor erhaltenen GoTo-Befehls", "drive", "2.1 Goto ACK: a goto is confirmed"),
    ("ein neuer GoTo-Befehl wird übernommen", "drive", "2.1 Goto: the new goto's place is reached"),
    ("der vorherige wird verworfen", "drive", "2.1 Goto: the goto before is dropped"),
    ("Endposition", "drive", "2.1 Goto: the place is reached"),
    ("Winkelauslegung gleich dem Einheitskreis", "drive", "1 and 2.1 Goto: the angle is reached"),
    ("Soll-Geschwindigkeit", "drive", "Table 1 Goto: a third of the speed takes longer"),
    ("normales Meiden", "barriers", "2.1 Barriers: a way round a normal barrier takes longer"),
    ("kann dies nicht garantieren", "barriers", "2.1 Barriers: a normal barrier is passed if need be"),
    ("zu 100% nicht passiert", "barriers", "2.1 Barriers: no way past a forced barrier"),
    ("Barrieren-Flags optional", "bytes", "Table 1 Goto: barriers are optional"),
    ("definiertes Bremsen", "drive", "2.1 Stop: the robot stands after a second"),
    ("der zuvor erhaltene GoTo-Befehl wird verworfen", "drive", "2.1 Stop: the goto is dropped"),
    ("Informationen zum Stopp-Grund", "canopen", "2.1 Extended Stop: the reason is kept"),
    ("ob die gewünschte Position bereits erreicht wurde", "drive", "2.1 State Response: 0 when the place is reached"),
    ("folgt direkt auf den State Request", "drive", "2.1 State Response: follows directly"),
    ("die geschätzte verbleibende Zeit", "drive", "2.1 State Response: the time falls"),
    ("1bit = 1ms", "drive", "Table 1 State Response: 1 bit is 1 ms"),
    ("Zeit unbekannt", "drive", "2.1 State Response: time unknown without a goto"),
    ("reiner Polling-Befehl", "core", "2.1 State Request: asked again while the drive is under way"),
    # 2.2 Estimated Location-Protokoll
    ("wird pollend eingesetzt", "core", "4.2.2 Navigation: the raw position is asked for"),
    ("folgt direkt auf einen Request", "drive", "2.2 Estimated Location response: follows directly"),
    ("folgt direkt auf einen Request", "navigation", "2.2 Estimated Location response: follows directly"),
    ("Position unbekannt", "drive", "2.2 Estimated Location response: unknown before the start configuration"),
    ("Position unbekannt", "navigation", "Table 2: an enemy that is not there is unknown"),
    ("ID-Quelle", "navigation", "Table 2: the source of enemy 1's place is enemy 1"),
    # 2.3 General Information Protocol
    ("Teamfarbe", "drive", "2.3 Start Configuration Set: yellow starts upper right"),
    ("die 5 Informationen", "core", "2.3 Start Configuration Set: colour, numbers and diameters"),
    ("Anzahl Gegner und Verbündete", "navigation", "2.3 Start Configuration Set: a new one counts"),
    ("Bestätigung, Antrieb", "drive", "2.3 Start Configuration Confirm: the drive confirms"),
    ("Bestätigung, Navigation", "navigation", "2.3 Start Configuration Confirm: the navigation confirms"),
    ("spezifischer Busteilnehmer", "drive", "2.3 Node Check Request: each node answers its own one only"),
    ("spezifischer Busteilnehmer", "navigation", "2.3 Node Check Request: each node answers its own one only"),
    ("quittieren, Antrieb", "drive", "2.3 Node Check Response: the drive is there"),
    ("quittieren, Navigation", "navigation", "2.3 Node Check Response: the navigation is there"),
    # 3 CAN-Protokoll
    ("Identifier des Antriebs", "bytes", "Table 4: Goto Confirm has the identifier 0x00C and no data"),
    ("Identifier der Navigation", "bytes-navigation", "Table 4: Check Navi Response has the identifier 0x380"),
    ("Sender und Empfänger", "navigation", "Table 5: the drive's and the core's messages are not answered"),
    # 4.2.2 Betrieb
    ("Position anfahren", "flows", "4.2.2 Drive to a position: polled until the place is reached"),
    ("definierter Zustand", "emergency", "4.2.2 Emergency mushroom: no goto is carried out"),
    ("broadcast an alle Knoten", "flows", "4.2.2 Emergency mushroom: both nodes still answer node checks"),
    ("Kern: Notaus-Pilz", "core", "4.2.2 Emergency mushroom: Emergency Shutdown"),
    ("sofortiger Stopp", "emergency", "4.2.2 Obstacle: the goto is dropped at once"),
    ("Kern: Hindernis", "core", "4.2.2 Obstacle: Emergency Stop for an enemy"),
    ("Rohdaten für die Kalman-Filterung", "drive", "4.2.2 Navigation: the drive takes the position into its estimate"),
    ("Position vom Kalman-Filter", "flows", "4.2.2 Position: request, and response with the filtered position"),
    # 5 System
    ("können jederzeit vorkommen", "drive", "5 System: messages for others are neither answered nor acted on"),
    ("Blockieren des Systems", "core", "5.1 Startup: a node that does not answer blocks the startup"),
    ("Ablauf Startup", "match", "5.1 Startup: the start is configured and confirmed"),
    ("ELP-Polling nach wie vor", "match", "5.2 Match: positions are polled meanwhile"),
    ("dazu GTP-Befehle", "flows", "5.2 Match: gotos and position polling do not disturb each other"),
)
"""What a node must obey by the document (a few of its words), and where that is checked."""


def names(suite: Suite) -> list[str]:
    """Return the names of a suite's steps."""
    return [step.name for step in suite.steps]


def suites() -> Iterator[tuple[str, str]]:
    for dialect in dialects.names():
        yield from ((dialect, name) for name in fault_matrix.shipped(dialect))


@pytest.mark.long
@pytest.mark.parametrize(("dialect", "name"), [*suites()])
def test_a_suite_is_green_without_a_fault(dialect: str, name: str) -> None:
    assert [fault_matrix.do(Run(dialect, name, None, seed)).red for seed in (1, 2)] == [(), ()]


@pytest.mark.parametrize("dialect", dialects.names())
def test_the_steps_that_faults_name_are_there(dialect: str) -> None:
    caught = {name: PLUGINS.find_fault(name)[1].caught_by for name in PLUGINS.fault_names()}
    made = {"conformance", "profile-402"}
    assert {suite for suite, _ in caught.values()} - PLUGINS.shipped_suites().keys() == made
    steps = {name: names(suite) for name, suite in fault_matrix.shipped(dialect).items()}
    shipped = fault_matrix.robot_faults()
    assert [name for name in shipped if caught[name].step not in steps[caught[name].suite]] == []


@rows("dialect, name", product(dialects.names(), fault_matrix.robot_faults()), sample=12)
def test_a_fault_turns_the_step_red_that_names_its_cause(dialect: str, name: str) -> None:
    outcome = fault_matrix.do(Run(dialect, PLUGINS.find_fault(name)[1].caught_by.suite, name))
    assert fault_matrix.named_red(name, outcome), outcome.red


@pytest.mark.parametrize("dialect", dialects.names())
@rows("words, suite, step", SENTENCES)
def test_every_sentence_of_the_document_has_a_step(dialect: str, words: str, suite: str, step: str) -> None:
    assert any(name.startswith(step) for name in names(fault_matrix.shipped(dialect)[suite])), words


@pytest.mark.parametrize(("dialect", "name"), [*suites()])
def test_steps_that_check_something_have_names_of_their_own(dialect: str, name: str) -> None:
    written = [each for each in names(fault_matrix.shipped(dialect)[name]) if ": " in each]
    assert len(set(written)) == len(written) >= 5


def test_the_matrix_tells_what_is_not_found() -> None:
    outcome = fault_matrix.Outcome(Run(dialects.DEFAULT, "drive", "goto-not-confirmed"), ("another step",))
    assert list(fault_matrix.missed([outcome])) == [
        "goto-not-confirmed: expected red is drive: '2.1 Goto ACK: a goto is confirmed'; red is drive: another step"
    ]
    assert list(fault_matrix.wrongly_red([outcome._replace(run=Run(dialects.DEFAULT, "drive", None, 7))])) == [
        f"drive ({dialects.DEFAULT}, seed 7): 'another step' is red without a fault"
    ]
