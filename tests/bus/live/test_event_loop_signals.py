"""SIGTERM as an exception: once, and not while a program is about to end."""

from __future__ import annotations

import signal
import threading

import pytest

from eurobot_od.bus.live.event_loop import TERMINATED, EndedBySigterm


def tell() -> None:
    signal.raise_signal(signal.SIGTERM)


def test_sigterm_raises_system_exit_and_the_handler_is_gone_afterwards() -> None:
    with pytest.raises(SystemExit) as ended, EndedBySigterm():
        tell()
    assert ended.value.code == TERMINATED == 143
    assert signal.getsignal(signal.SIGTERM) == signal.SIG_DFL


def test_a_second_sigterm_does_not_cut_the_end_short() -> None:
    done = []

    def end_slowly() -> None:
        with EndedBySigterm():
            try:
                tell()
            finally:
                tell()
                done.append(True)

    with pytest.raises(SystemExit):
        end_slowly()
    assert done


def test_sigterm_during_cleanup_waits_for_its_end() -> None:
    done = []

    def end() -> None:
        with EndedBySigterm() as sigterm:
            sigterm.hold()
            tell()
            done.append(True)

    with pytest.raises(SystemExit) as ended:
        end()
    assert (done, ended.value.code) == ([True], TERMINATED)


def test_an_error_of_the_end_is_not_hidden_by_it() -> None:
    def fail() -> None:
        with EndedBySigterm() as sigterm:
            sigterm.hold()
            tell()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        fail()


def test_a_handler_of_the_programs_own_stays() -> None:
    told = []
    before = signal.signal(signal.SIGTERM, lambda *_: told.append(True))
    try:
        with EndedBySigterm():
            tell()
        assert told
        assert signal.getsignal(signal.SIGTERM) != signal.SIG_DFL
    finally:
        signal.signal(signal.SIGTERM, before)


def test_outside_the_main_thread_it_does_nothing() -> None:
    handlers = []

    def run() -> None:
        with EndedBySigterm():
            handlers.append(signal.getsignal(signal.SIGTERM))

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert handlers == [signal.SIG_DFL]
