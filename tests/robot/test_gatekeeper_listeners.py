"""Message queues: first in, first out, the newest kept, and the one thing a program may wait at."""

from __future__ import annotations

import threading

import pytest

from eurobot_od.controller import ListenerStatistics, MessageQueue, Received, Report


def item(number: int) -> Received[int]:
    return Received(number, float(number))


def numbers(queue: MessageQueue[int]) -> list[int]:
    return [received.message for received in queue.drain()]


KEPT = [
    (0, 5, [0, 1, 2, 3, 4], []),  # no bound
    (5, 5, [0, 1, 2, 3, 4], []),  # full, but nothing too much
    (4, 5, [1, 2, 3, 4], [4.0]),  # the oldest makes room, and the first loss is reported at once
    (1, 5, [4], [1.0, 2.0, 4.0]),  # loss 1, 2 and 4 are reported
    (1, 9, [8], [1.0, 2.0, 4.0, 8.0]),  # and 8
]


@pytest.mark.parametrize(("maxsize", "count", "kept", "reported"), KEPT)
def test_the_newest_are_kept_in_order_and_losses_reported(
    maxsize: int, count: int, kept: list[int], reported: list[float]
) -> None:
    reports: list[Report] = []
    queue = MessageQueue[int]("gotos", maxsize, reports.append)
    for number in range(count):
        queue.put(*item(number))
    assert queue.statistics() == ListenerStatistics("gotos", delivered=count, lost=count - len(kept))
    assert (len(queue), numbers(queue), [each.timestamp for each in reports]) == (len(kept), kept, reported)


def test_an_overflow_names_queue_size_and_count() -> None:
    reports: list[Report] = []
    queue = MessageQueue[int]("gotos", 1, reports.append)
    queue.put(*item(0))
    queue.put(*item(1))
    [report] = reports
    assert str(report) == "queue overflow: gotos: full with 1 messages, 1 lost so far; the newest are kept"


def test_get_takes_the_oldest() -> None:
    queue = MessageQueue[int]("gotos", 0, print)
    for number in range(3):
        queue.put(*item(number))
    assert (queue.get(), queue.get(timeout=1.0), queue.get_nowait()) == (item(0), item(1), item(2))


def test_an_empty_queue_gives_none() -> None:
    queue = MessageQueue[int]("gotos", 0, print)
    assert (queue.get(timeout=-1.0), queue.get(timeout=0.001), queue.get_nowait(), queue.drain()) == (
        None,
        None,
        None,
        [],
    )


def test_get_waits_for_a_message_of_another_thread() -> None:
    queue = MessageQueue[int]("gotos", 0, print)
    thread = threading.Thread(target=queue.put, args=item(7))
    thread.start()
    assert queue.get(timeout=60.0) == item(7)
    thread.join()


def test_many_readers_share_what_is_put_and_what_is_missing_is_counted() -> None:
    reports: list[Report] = []
    queue = MessageQueue[int]("gotos", 10, reports.append)
    taken: list[int] = []

    def read() -> None:
        while (received := queue.get()) is not None and received.message >= 0:
            taken.append(received.message)

    readers = [threading.Thread(target=read) for _ in range(3)]
    for reader in readers:
        reader.start()
    for number in range(2000):
        queue.put(*item(number))
    for _ in readers:
        queue.put(*item(-1))
    for reader in readers:
        reader.join()
    assert len(taken) == len(set(taken)) == 2000 - queue.lost
