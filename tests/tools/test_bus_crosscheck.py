"""The crosscheck in short, and that it would see a bound that is too low."""

from __future__ import annotations

from random import Random

import bus_crosscheck
import pytest
from bus_crosscheck import attempt, crosscheck, random_set, summary, worst_frame, wrong

from eurobot_od import bus
from eurobot_od.bus import frame_bits, longest_frame
from eurobot_od.traffic.load import Analysis


@pytest.mark.parametrize("number", [0, 3, 4, 5])
def test_no_message_is_later_than_its_bound_and_one_comes_near(number: int) -> None:
    outcome = attempt(number, 2000)
    assert outcome.frames >= 1990  # as near as whole messages come
    assert not wrong(outcome), outcome


def test_a_bound_that_is_too_low_is_found(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bus, "STUFFABLE", 26)  # a byte less than a frame has
    messages, bit_rate = random_set(Random("set 4"))
    outcome = crosscheck("set 4", messages, bit_rate, 500)
    assert wrong(outcome)
    assert outcome.over[0].startswith("set 4: message ")
    assert "response times over their bound" in summary([outcome])


def test_mailboxes_are_needed_in_the_analysis(monkeypatch: pytest.MonkeyPatch) -> None:
    """At its critical instant a message does wait for a mailbox on the simulated bus."""
    monkeypatch.setattr(Analysis, "rivals", lambda *_: [])
    assert attempt(0, 500).over


@pytest.mark.parametrize("identifier", [0x000, 0x0AA, 0x555, 0x7FF])
@pytest.mark.parametrize("length", [0, 1, 4, 8])
def test_worst_frame_is_nearly_as_long_as_a_frame_can_be(identifier: int, length: int) -> None:
    frame = worst_frame(identifier, length)
    assert (frame.cob_id, len(frame.data)) == (identifier, length)
    assert 0.85 * longest_frame(length) <= frame_bits(frame) <= longest_frame(length)


@pytest.mark.long
def test_the_command(capsys: pytest.CaptureFixture[str]) -> None:
    assert bus_crosscheck.main(["--frames", "100", "--sets", "1", "--jobs", "1"]) == bus_crosscheck.FINE
    assert "frames of 5 sets: 0 response times over their bound" in capsys.readouterr().out
