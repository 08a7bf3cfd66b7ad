"""The sender: order, a driver that takes nothing, and an interrupt at any line."""

from __future__ import annotations

import errno
from collections.abc import Iterator

import can
import pytest

from eurobot_od.bus.live.buses import FIRST_PAUSE, LONGEST_PAUSE, STUCK_AFTER
from eurobot_od.controller import TransmitQueue
from eurobot_od.frame import Frame
from tests.bus.live.sender import FRAMES, Scene, interrupt_at_any_line


@pytest.fixture
def scene() -> Iterator[Scene]:
    scene = Scene(TransmitQueue())
    with scene.wire:
        yield scene


def test_waiting_frames_leave_in_order_of_priority(scene: Scene) -> None:
    scene.submit(*FRAMES)
    scene.sender.pump()
    assert scene.wire.sent == sorted(FRAMES)
    assert (scene.sender.busy, scene.sender.blocked, scene.woken) == (False, False, 0)


ERRORS = {"refused": can.CanOperationError("buffer full"), "failed": OSError("adapter was pulled out")}


@pytest.mark.parametrize("error", ERRORS.values(), ids=ERRORS)
def test_a_driver_that_takes_nothing_is_tried_after_growing_pauses_and_only_by_retry(
    scene: Scene, error: Exception
) -> None:
    scene.wire.error = error
    scene.submit(*FRAMES)
    scene.sender.pump()
    pauses = [scene.sender.pause]
    for _ in range(9):
        scene.sender.pump()  # nothing
        scene.sender.retry()
        pauses.append(scene.sender.pause)
    assert pauses == [min(FIRST_PAUSE * 2**doublings, LONGEST_PAUSE) for doublings in range(10)]
    assert (scene.sender.blocked, scene.woken, len(scene.failures)) == (True, 10, 10 * isinstance(error, OSError))
    scene.wire.error = None
    scene.sender.retry()
    assert (scene.wire.sent, scene.sender.pause) == (sorted(FRAMES), 0.0)


def test_a_driver_that_takes_no_frame_for_a_second_has_failed_in_its_words(scene: Scene) -> None:
    scene.wire.error = can.CanOperationError("Transmit buffer full")
    scene.submit(*FRAMES)
    for now in (0.0, 0.5, 0.999):
        scene.now = now
        scene.sender.retry()
    assert scene.failures == []
    scene.now = STUCK_AFTER
    scene.sender.retry()
    assert [str(each) for each in scene.failures] == ["the bus wire has taken no frame for 1.0 s: Transmit buffer full"]


def test_a_driver_that_takes_one_frame_in_between_has_not_failed(scene: Scene) -> None:
    scene.submit(*FRAMES)
    for now in (0.0, 0.9, 1.8):
        scene.now, scene.wire.error = now, None
        scene.submit(Frame(0x001))
        scene.sender.retry()
        scene.wire.error = can.CanOperationError("Transmit buffer full")
        scene.submit(Frame(0x001))
        scene.sender.retry()
    assert scene.failures == []


KERNEL = {
    "no room": (OSError(errno.ENOBUFS, "No buffer space available"), False),
    "down": (OSError(errno.ENETDOWN, "Network is down"), True),
    "gone": (OSError(errno.ENODEV, "No such device"), True),
}
"""What the kernel says when SocketCAN sends, and whether the bus is lost then; python-can makes a CanError of both."""


@pytest.mark.parametrize(("cause", "lost"), KERNEL.values(), ids=KERNEL)
def test_errno_distinguishes_a_full_buffer_from_a_lost_bus(scene: Scene, cause: OSError, lost: bool) -> None:
    scene.wire.error = can.CanOperationError(f"Failed to transmit: {cause.strerror}", cause.errno)
    scene.wire.error.__cause__ = cause
    scene.submit(*FRAMES)
    scene.sender.pump()
    assert [str(each).startswith("the bus wire failed: Failed to transmit") for each in scene.failures] == [True] * lost


def test_an_interrupt_at_any_line_loses_no_frame_and_gives_the_turn_back() -> None:
    assert interrupt_at_any_line(TransmitQueue) > len(FRAMES)
