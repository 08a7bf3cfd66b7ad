"""A bus, or one of the parts it has been cut into: who may send when, and what has become of it at which time.

An attempt to send begins when the bus is free and somebody has a frame. What will become of it is clear at that moment:
the bits are played out at once (`access`), and what happens in them is dated. Where nothing can go wrong (no bit error,
nobody else with the same identifier, somebody who acknowledges), what happens is known without playing: a frame ends,
once for all. `tests/bus/simulated/test_bus.py` shows that playing gives the same.

Rule of this file: a moment of an attempt is reported when its time has come, and not at all if it is taken back first.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import partial
from heapq import merge
from itertools import chain, tee
from math import inf
from typing import NamedTuple, TypeAlias

from eurobot_od.bus.simulated.access import MediumAccess
from eurobot_od.bus.simulated.bit_errors import Attempt, BitErrors, Flip
from eurobot_od.bus.simulated.bits import INTERMISSION, on_wire
from eurobot_od.bus.simulated.confinement import FRESH, RECOVERY_BITS, Counters, CountingRule, ErrorState
from eurobot_od.bus.simulated.controller import Controller
from eurobot_od.frame import Frame

SUSPENDED = 8
"""Bits that an error passive controller lets pass after its own frame, so that the others come first."""

ROUNDING = 1e-3
"""Bits by which a time may miss the end of the bit that it stands for: times are floating point."""

Ended: TypeAlias = Callable[[Frame, Sequence[Controller], Sequence[Controller]], None]
"""Takes a frame that has ended: who has sent it, and whom it has reached."""

Changed: TypeAlias = Callable[[Controller, ErrorState, ErrorState], None]
"""Takes a controller, the state it was in, and another one in which it is now."""

NEVER = Flip(1 << 62)
"""A bit error that does not come."""

NO_FLIPS: Iterator[Flip] = tee(())[0]
"""No bit errors in an attempt."""


class Moment(NamedTuple):
    """What happens `bit` bits after the start of frame: what is counted, and a frame that ends."""

    bit: int
    counts: Sequence[tuple[Controller, CountingRule]]
    frame: Frame | None = None
    senders: Sequence[Controller] = ()
    receivers: Sequence[Controller] = ()


class Course(NamedTuple):
    """What becomes of an attempt: its moments, after how many bits the bus is free, and how it leaves the controllers.

    `suspended` are those that let others go first, `sequences` what those that are bus-off have seen.
    """

    moments: Sequence[Moment]
    bits: int
    suspended: Sequence[Controller]
    sequences: Sequence[tuple[Controller, int]]


class Play:
    """Plays an attempt bit by bit, from its start of frame until all controllers are idle."""

    def __init__(self, parts: Sequence[MediumAccess], flips: Iterable[Flip] = ()) -> None:
        self.parts, self.bit = parts, 0
        self.moments: list[Moment] = []
        self._flips = iter(flips)
        self._flip = next(self._flips, None)

    def run(self, until: float = inf) -> Play:
        """Go on until all are idle, or until a bit."""
        while self.bit < until and not all(part.idle for part in self.parts):
            # The wire is a wired AND: one dominant level, 0, wins over all recessive ones.
            level = min(part.level for part in self.parts)
            flips: list[Flip] = []  # the bit errors of this bit
            while self._flip is not None and self._flip.bit <= self.bit:
                flips.append(self._flip)
                self._flip = next(self._flips, None)
            for part in self.parts:
                # Two errors in one bit undo each other.
                flipped = sum(flip.at in (None, part.controller) for flip in flips) % 2
                part.see(level ^ flipped)
            self.bit += 1
            if any(part.noted for part in self.parts):
                self.moments.extend(self._noted())
        return self

    @property
    def course(self) -> Course:
        """What has become of the attempt."""
        return Course(
            self.moments,
            self.bit,
            [part.controller for part in self.parts if part.suspends],
            [(part.controller, part.sequences) for part in self.parts if part.off],
        )

    def _noted(self) -> Iterator[Moment]:
        """Give what was noted in the last bit: the counts, and each frame that has ended with it."""
        notes = [(part.controller, note) for part in self.parts for note in part.noted]
        for part in self.parts:
            part.noted.clear()
        yield Moment(self.bit, [(each, note) for each, note in notes if isinstance(note, CountingRule)])
        through = [(each, note) for each, note in notes if not isinstance(note, CountingRule)]
        for frame in dict.fromkeys(note.frame for _, note in through):
            senders, receivers = ([each for each, note in through if note == (frame, sent)] for sent in (True, False))
            yield Moment(self.bit, (), frame, senders, receivers)


Parts: TypeAlias = Callable[[], list[MediumAccess]]
"""Makes the controllers as they were at some time, as often as it is called."""


class Beginning(NamedTuple):
    """How an attempt begins: who is there, with which counters, and which of them send what."""

    here: Sequence[Controller]
    counters: Sequence[Counters]
    offers: dict[Controller, Frame]

    def parts(self) -> list[MediumAccess]:
        """Make the controllers."""
        return [MediumAccess(each, counters, self.offers.get(each)) for each, counters in zip(self.here, self.counters)]


@dataclass
class UnderWay:
    """An attempt that is under way since `start`, s, how the controllers were then, and how many moments are out."""

    start: float
    parts: Parts
    flips: Iterator[Flip]
    course: Course
    reported: int = 0

    def next_event(self, bitrate: int) -> float:
        """When the next moment has come, or the bus is free, in seconds."""
        course = self.course
        bit = course.moments[self.reported].bit if self.reported < len(course.moments) else course.bits
        return self.start + bit / bitrate

    def parts_at(self, bit: int) -> list[MediumAccess]:
        """Return the controllers as they are after `bit` bits."""
        return list(Play(self.parts(), copy(self.flips)).run(bit).parts)


class Bus:
    """Controllers that hear each other, at `bitrate` bit/s; `ended` and `changed` are called with what happens.

    All methods take the time in seconds. `next_event` is when `advance` has something to do, infinite if nothing is
    planned. Nothing is sent before `off_until`.
    """

    def __init__(self, bitrate: int, bit_errors: Sequence[BitErrors], ended: Ended, changed: Changed) -> None:
        self.bitrate, self.controllers = bitrate, list[Controller]()
        self._bit_errors, self._ended, self._changed = bit_errors, ended, changed
        self.off_until = 0.0
        self._under_way: UnderWay | None = None
        self._idle_since = 0.0
        self.next_event = inf

    def is_free(self, now: float) -> bool:
        """Tell whether an attempt may begin."""
        return self._under_way is None and self.off_until <= now

    def advance(self, now: float) -> None:
        """Do what is due by now."""
        while self.next_event <= now:
            self._step(now)

    def _step(self, now: float) -> None:
        attempt = self._under_way
        if attempt is None:
            self._pass_idle(now)
        elif attempt.reported == len(attempt.course.moments):
            self._finish(attempt.course, now)
        else:
            moment = attempt.course.moments[attempt.reported]
            # Counted before anybody is called: a listener may cut the bus, and a moment must not be reported twice.
            attempt.reported += 1
            self.next_event = attempt.next_event(self.bitrate)
            for controller, rule in moment.counts:
                # Only changes are reported: a bad line counts at every frame, and a node wants to hear of the state
                # that follows.
                before = controller.state
                controller.count(rule)
                if controller.state is not before:
                    self._changed(controller, before, controller.state)
            if moment.frame is not None:
                self._ended(moment.frame, moment.senders, moment.receivers)

    def _finish(self, course: Course, now: float) -> None:
        self._under_way, self._idle_since = None, now
        # Suspended: an error passive sender lets the others begin first (ISO 11898-1, suspend transmission).
        for controller in course.suspended:
            # Otherwise one that disturbs each frame would begin again with the next one, and with a low identifier
            # nobody else would ever get through.
            controller.suspended_until = now + SUSPENDED / self.bitrate
        for controller, sequences in course.sequences:
            self._recover(controller, sequences)
        self.next_event = inf
        if course.suspended or course.sequences:
            self._look_ahead(now)

    # The idle bus

    def _look_ahead(self, now: float) -> None:
        """Note when something changes if nobody sends until then: who is suspended may, who is bus-off is back."""
        sequence = RECOVERY_BITS / self.bitrate
        recovery = (self._idle_since + each.recovery * sequence for each in self.controllers if each.recovery)
        suspended = (each.suspended_until for each in self.controllers if each.suspended_until > now)
        self.next_event = min((*recovery, *suspended), default=inf)

    def _pass_idle(self, now: float) -> None:
        """Count the recessive bits that have passed since the bus was free."""
        if any(each.recovery for each in self.controllers):
            sequences = int(((now - self._idle_since) * self.bitrate + ROUNDING) / RECOVERY_BITS)
            # Only whole sequences are taken off; the rest of one goes on counting.
            self._idle_since += sequences * RECOVERY_BITS / self.bitrate
            for each in self.controllers:
                self._recover(each, sequences)
        self._look_ahead(now)

    def _recover(self, controller: Controller, sequences: int) -> None:
        if controller.recovery and controller.recovers(sequences):
            self._changed(controller, ErrorState.OFF, controller.state)

    # Attempts

    def arbitrate(self, now: float) -> None:
        """Let those who have frames begin, if the bus is free."""
        if self.is_free(now):
            offers = {
                each: frame
                for each in self.controllers
                if (frame := each.source.urgent()) is not None and each.may_send(now)
            }
            if offers:
                self._begin(now, offers)

    def _begin(self, now: float, offers: dict[Controller, Frame]) -> None:
        if self.next_event < inf:
            self._pass_idle(now)
        # Bus-off controllers take part as well: they count recessive bits within frames, too.
        here = [each for each in self.controllers if each.silent_until <= now or each.recovery]
        start = Beginning(here, [each.counters for each in here], offers)
        # Frames compare by their identifier first, so the least one wins the arbitration.
        frame = min(offers.values())
        end = on_wire(frame).end
        flips = self._flips(Attempt(now, frame, end, tuple(offers))) if self._bit_errors else NO_FLIPS
        course = undisturbed(frame, offers, here) if flips is NO_FLIPS else None
        self._go(UnderWay(now, start.parts, flips, course or Play(start.parts(), copy(flips)).run().course))

    def _flips(self, attempt: Attempt) -> Iterator[Flip]:
        """Ask for the bit errors of an attempt; what is returned can be copied, to begin from the start again."""
        sources = [iter(errors(attempt)) for errors in self._bit_errors]
        firsts = [next(source, NEVER) for source in sources]
        if min(first.bit for first in firsts) >= attempt.bits + INTERMISSION:
            return NO_FLIPS  # most attempts, even on a bad bus: `_begin` need not play them
        # An iterator of tee's can be copied, so `leave` can play an attempt again up to some bit.
        return tee(merge(*map(chain, zip(firsts), sources), key=lambda flip: flip.bit))[0]

    def _go(self, attempt: UnderWay) -> None:
        self._under_way, self.next_event = attempt, attempt.next_event(self.bitrate)

    # Who hears whom

    def drop(self, now: float) -> None:
        """Have what is under way come to nothing."""
        if self._under_way is not None:
            self._rest(now)

    def _rest(self, now: float) -> None:
        self._under_way, self._idle_since = None, now
        self._look_ahead(now)

    def leave(self, now: float) -> Parts:
        """Return how the controllers are now, in the midst of whatever is under way."""
        attempt = self._under_way
        if attempt is not None:
            # A function, not a list: each part of a cut bus plays on with controllers of its own.
            return partial(attempt.parts_at, int((now - attempt.start) * self.bitrate + ROUNDING))
        self._pass_idle(now)
        here = [(each, each.counters) for each in self.controllers if each.silent_until <= now]
        return lambda: [MediumAccess(each, counters, None) for each, counters in here]

    def go_on(self, now: float, controllers: Iterable[Controller], parts: Parts) -> None:
        """Have other controllers, who go on from where they are: what one sends from now on, all these see."""
        self.controllers[:] = controllers
        self._rest(now)
        playing = parts()
        if not all(part.idle for part in playing):
            self._go(UnderWay(now, parts, NO_FLIPS, Play(playing).run().course))


def regroup(now: float, buses: Iterable[Bus], groups: Iterable[tuple[Bus, Sequence[Controller]]]) -> None:
    """Have the controllers of some buses hear others from now on: each bus of `groups` gets those beside it."""
    were = [bus.leave(now) for bus in buses]
    for bus, controllers in groups:
        # All have left before the first goes on: what a controller sends from now on depends on what it has seen so
        # far, not on whom it hears next.
        bus.go_on(now, controllers, partial(_chosen, were, controllers))


def _chosen(were: Iterable[Parts], controllers: Sequence[Controller]) -> list[MediumAccess]:
    return [part for parts in were for part in parts() if part.controller in controllers]


def undisturbed(frame: Frame, offers: dict[Controller, Frame], here: Sequence[Controller]) -> Course | None:
    """Return what becomes of an attempt in which nothing can go wrong, None if something may."""
    # Two nodes with the same identifier and data win together, and nobody notices: the bits on the wire are equal.
    senders = [each for each, offer in offers.items() if offer == frame]
    receivers = [each for each in here if offers.get(each) != frame and not each.recovery]
    # Without a receiver nobody acknowledges; two frames with one identifier collide after the arbitration.
    if not receivers or any(each.cob_id == frame.cob_id and each != frame for each in offers.values()):
        return None
    end = on_wire(frame).end
    # Counters at 0 stay there whatever is sent or received: nearly always there is nothing to count.
    worn = [each for each in here if each.counters is not FRESH]
    counts = [
        (each, CountingRule.TRANSMITTED if each in senders else CountingRule.RECEIVED)
        for each in worn
        if not each.recovery
    ]
    suspended = [
        each for each, rule in counts if each in senders and each.counters.after(rule).state is ErrorState.PASSIVE
    ]
    # Each frame has one sequence of 11 recessive bits: from the acknowledge delimiter to the intermission, 1 + 7 + 3.
    sequences = [(each, 1) for each in worn if each.recovery]
    return Course((Moment(end, counts, frame, senders, receivers),), end + INTERMISSION, suspended, sequences)
