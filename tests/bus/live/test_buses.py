"""What a driver does with a frame: takes it, has no room for it now, or has failed."""

from __future__ import annotations

import errno
import logging

import can
import pytest
from can.interfaces.virtual import VirtualBus

from eurobot_od.bus.live import Driver, open_bus
from eurobot_od.errors import BusError
from eurobot_od.frame import Frame

FRAME = Frame(0x123, b"\1\2")


class Bus(can.BusABC):
    """A bus whose `send` raises `error`, if there is one, and keeps what it was given."""

    channel_info = "test"

    def __init__(self, error: Exception | None = None) -> None:
        self.error, self.sent = error, list[tuple[can.Message, float | None]]()

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        self.sent.append((msg, timeout))
        if self.error:
            raise self.error

    def shutdown(self) -> None:
        self._is_shutdown = True


def refused(number: int | None) -> can.CanError:
    """What python-can raises because of an operating system's error, or of its own accord."""
    error = can.CanError("Transmit buffer\nfull")
    error.__cause__ = None if number is None else OSError(number, "said so")
    return error


def test_a_frame_is_handed_over_as_it_is() -> None:
    bus = Bus()
    assert Driver(bus).send(FRAME, timeout=0.25)
    ((message, timeout),) = bus.sent
    assert (message.arbitration_id, bytes(message.data), message.is_extended_id, timeout) == (
        0x123,
        b"\1\2",
        False,
        0.25,
    )
    assert not message.is_remote_frame
    assert not message.is_error_frame


@pytest.mark.parametrize("number", [None, errno.ENOBUFS, errno.EAGAIN, errno.ETIMEDOUT])
def test_a_full_driver_takes_no_frame_and_says_why(number: int | None) -> None:
    driver = Driver(Bus(refused(number)))
    assert not driver.send(FRAME)
    assert driver.refusal == "Transmit buffer full"
    assert str(driver.stuck(1.25)) == "the bus test has taken no frame for 1.2 s: Transmit buffer full"


@pytest.mark.parametrize("error", [refused(errno.ENETDOWN), refused(errno.ENODEV), OSError("gone"), ValueError("odd")])
def test_any_other_error_means_that_the_bus_has_failed(error: Exception) -> None:
    with pytest.raises(BusError, match=r"^the bus test failed: "):
        Driver(Bus(error)).send(FRAME)


def test_an_error_of_a_bus_that_was_replaced_meanwhile_is_only_a_frame_not_taken() -> None:
    class Replaced(Bus):
        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            driver.replace(Bus)
            raise OSError("closed")

    driver = Driver(Replaced())
    assert not driver.send(FRAME)


def test_who_is_told_not_to_wait_and_does_not_is_prompt() -> None:
    with VirtualBus("test-buses") as bus:
        assert (Driver(bus).prompt, Driver(bus).filters, Driver(bus).overflow) == (True, False, 0)
    slow = Bus()
    driver = Driver(slow)
    assert (driver.prompt, driver.filters) == (False, False)
    driver.send(FRAME)
    ((_, timeout),) = slow.sent
    assert timeout is not None
    assert 0 < timeout < 0.1


def test_what_drivers_log_is_kept_off_the_terminal_when_a_bus_is_opened(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    """Python writes warnings that nobody has asked for to the terminal; a driver's errors are raised, too."""
    for name in ("can", ""):
        monkeypatch.setattr(logging.getLogger(name), "handlers", [])
    open_bus("virtual", "quiet").shutdown()
    logging.getLogger("can").warning("the driver says so")
    assert capfd.readouterr() == ("", "")
