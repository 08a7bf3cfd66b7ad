"""Actions with frames: send, answer, expect, and save their values."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import NamedTuple

from eurobot_od.check import suite
from eurobot_od.check.bench import SeenFrame
from eurobot_od.check.shapes import COUNT, DURATION, NAME, SOME_TIME, WITHIN, ActionRow, DocumentShapes, with_0x
from eurobot_od.check.suite import FramePattern, Mismatch, Order, Pattern, Patterns, Sent, ServicePattern, is_final
from eurobot_od.check.tester import LATEST, BenchTester, Failed, Skipped
from eurobot_od.frame import HIGHEST_IDENTIFIER
from eurobot_od.support import texts, yaml_shapes
from eurobot_od.support.declared import Within
from eurobot_od.support.texts import amount
from eurobot_od.support.yaml_shapes import NUMBER, Key, Shape

REGISTER = 2
"""Byte of the error register in an EMCY (CiA 301, 7.2.7.4)."""

LATE_ONES = (ServicePattern, FramePattern)
"""Patterns whose missed frames are waited for before the next step."""

EVERY = {"every": Key(SOME_TIME, "time from one to the next", needed=True)}


class Send(NamedTuple):
    """Send a message or frame."""

    sent: Sent

    def __str__(self) -> str:
        return f"send {self.sent}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        if not tester.is_asking:  # several in a row are one request, or the second would lose the answer to the first
            tester.ask()
        await tester.put_raw(self.sent.frame(tester.variables))

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(shapes.frames.sent, Send)


class Answer(NamedTuple):
    """From now on answer each frame with one of these COB-IDs, as a node would; None ends its answers."""

    answers: Mapping[int, Sent | None]

    def __str__(self) -> str:
        return f"answer {', '.join(f'0x{cob_id:03X}' for cob_id in self.answers)}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        for cob_id, sent in self.answers.items():
            tester.answers.pop(cob_id, None)
            if sent is not None:
                tester.answers[cob_id] = sent

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(shapes.frames.answers, Answer)


class Expect(NamedTuple):
    """Wait for frames for up to `within` s (None: the suite's timeout)."""

    expected: Patterns
    within: float | None = None

    def __str__(self) -> str:
        return f"expect {self.expected}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        order = self.expected.order
        left = list(self.expected.patterns)
        begun = tester.trace.now
        longest = tester.longest(self.within)
        deadline = begun + longest
        start = tester.mark
        other = None
        while left:
            found = await tester.next(left, start, deadline)
            if found is None:
                tester.missed = (LATEST - longest) * any(isinstance(each, LATE_ONES) for each in left)
                what = f"no {' or '.join(map(str, left))} within {texts.text(longest)}"
                if other is not None:
                    raise tester.with_last(what, left[0], other)
                raise Failed(what, "; ".join(each.text(tester.variables) for each in left), "nothing")
            number, seen = found
            start = number + 1
            # In order, only the first pattern may match; a frame for a later one is out of order.
            tried = left[:1] if order is suite.Order.IN_ORDER else left
            hit = next((each for each in tried if not tester.mismatches(each, seen)), None)
            if hit is not None:
                tester.use(number)
                if isinstance(hit, ServicePattern) and hit.save is not None:
                    tester.variables[hit.save] = seen.frame.data[REGISTER]
                left = [] if order is suite.Order.ANY else [each for each in left if each is not hit]
                tester.note_wait(seen.time - begun, longest)
                start = tester.mark  # the remaining patterns may match frames that were passed over
            elif any(is_final(each, seen.frame) for each in left if each.cob_id == seen.frame.cob_id):
                # The error names the closest pattern: of the same message, with the fewest differences.
                ranks = [(each.cob_id != seen.frame.cob_id, len(tester.mismatches(each, seen))) for each in tried]
                nearest = tried[ranks.index(min(ranks))]
                raise tester.with_last(f"{nearest} is not as expected", nearest, seen)
            else:
                other = seen

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(shapes.frames.patterns, Expect, WITHIN)

    @staticmethod
    def heartbeat(shapes: DocumentShapes) -> ActionRow:
        """Return the row for `heartbeat`."""
        return _row_of_one(shapes.services.heartbeat)

    @staticmethod
    def emcy(shapes: DocumentShapes) -> ActionRow:
        """Return the row for `emcy`."""
        return _row_of_one(shapes.services.emcy)


class Await(NamedTuple):
    """Wait for up to `within` s until a matching frame comes; other frames do not fail the step."""

    pattern: Pattern
    within: float | None = None

    def __str__(self) -> str:
        return f"await {self.pattern}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        start = len(tester.trace)
        last = None
        deadline = tester.deadline(self.within)
        while (found := await tester.next([self.pattern], start, deadline)) is not None:
            number, last = found
            start = number + 1
            if not tester.mismatches(self.pattern, last):
                tester.use(number)
                return
        what = f"{self.pattern} not as wanted within {texts.text(tester.longest(self.within))}"
        raise tester.with_last(what, self.pattern, last)

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(shapes.frames.pattern, Await, WITHIN)


class Never(NamedTuple):
    """Fail if a matching frame comes within `span` s."""

    pattern: Pattern
    span: float

    def __str__(self) -> str:
        return f"never {self.pattern}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        start = tester.edge
        deadline = tester.deadline(self.span)
        while (found := await tester.next([self.pattern], start, deadline)) is not None:
            number, seen = found
            if not tester.mismatches(self.pattern, seen):
                what = f"{self.pattern} came, though it should not"
                raise Failed(what, f"never {self.pattern.text(tester.variables)}", tester.meaning(seen))
            start = number + 1
        tester.edge = len(tester.trace)

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        span = Key(DURATION, "how long none may come", needed=True)
        # `for` is a keyword of Python, so it cannot name a parameter
        return ActionRow(shapes.frames.pattern, lambda pattern, **keys: Never(pattern, keys["for"]), {"for": span})


class Poll(NamedTuple):
    """Send again and again until a matching frame comes, for up to `within` s.

    The time from one to the next is multiplied by `factor` each time.
    """

    sent: Sent
    every: float
    factor: int
    until: Pattern
    within: float | None = None

    def __str__(self) -> str:
        return f"poll {self.sent}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        tester.ask()
        started = tester.trace.now
        start = tester.mark
        last = None
        deadline = tester.deadline(self.within)
        count = 0
        periods = 0
        while tester.trace.now < deadline:
            await tester.put(self.sent.frame(tester.variables))
            periods += self.factor**count
            count += 1
            # counted from the start, so that the time for sending does not add up
            pause = min(started + periods * self.every, deadline)
            while (found := await tester.next([self.until], start, pause)) is not None:
                number, last = found
                start = number + 1
                if not tester.mismatches(self.until, last):
                    tester.use(number)
                    tester.note_wait(last.time - started, tester.longest(self.within))
                    return
        raise tester.with_last(f"{self.until} not as wanted after {count} x {self.sent}", self.until, last)

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        question = {"send": Key(shapes.frames.sent, "what is sent", needed=True), **EVERY, "factor": Key(COUNT)}
        until = {"until": Key(shapes.frames.pattern, "which frame ends it", needed=True), **WITHIN}
        polled = yaml_shapes.record(lambda send, every, factor=1: (send, every, factor), question)
        return ActionRow(polled, lambda parts, **keys: Poll(*parts, **keys), until)


@dataclass(frozen=True)  # not a named tuple: those have a method `count`
class Period:
    """Fail unless `count` distances between frames are `every` s, within the tolerance.

    The median has to be within `tolerance`, each single distance as well, plus the time by which the tester itself was
    late; `worst` replaces `tolerance` for a single one.
    """

    message: Pattern
    every: float
    tolerance: float
    count: int
    worst: float | None = None

    @property
    def most(self) -> float:
        """Tolerance of a single distance, in s."""
        return self.tolerance if self.worst is None else self.worst

    def __str__(self) -> str:
        return f"period of {self.message}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        with tester.trace.lateness() as late:
            seen = await self._seen(tester)
            own = late()
        distances = [second.time - first.time for first, second in pairwise(seen)]
        worst = max(distances, key=lambda each: abs(each - self.every))
        wanted = f"{texts.text(self.every)} +- {texts.text(self.tolerance)}"
        late_too = f" (the tester itself was late by up to {texts.text(own)})" if own > 0 else ""
        shown = f"{texts.text(worst)}{late_too}"
        off = [
            Mismatch(what, wanted, came)
            for what, distance, came, allowed in (
                ("median", median(distances), texts.text(median(distances)), self.tolerance),
                (f"period {distances.index(worst) + 1}", worst, shown, self.most + own),
            )
            if abs(distance - self.every) > allowed
        ]
        if off:
            raise tester.with_last(f"{self.message} is not as expected", self.message, seen[-1], off)
        if abs(worst - self.every) > self.tolerance:
            tester.remark = f"{self.message} every {wanted}: at the worst {shown}"

    async def _seen(self, tester: BenchTester) -> list[SeenFrame]:
        """Return the frames of the periods, one more than there are periods."""
        seen: list[SeenFrame] = []
        for number in range(self.count + 1):
            # Long enough for a late frame, not for the one after a missing frame.
            latest = self.most + self.every * (1 + bool(seen))
            start = seen[-1].time if seen else tester.trace.now
            found = await tester.next([self.message], tester.edge, start + latest)
            if found is None:
                tester.missed = LATEST * isinstance(self.message, LATE_ONES)
                what = f"no {self.message} within {texts.text(latest)}, after {number} of them"
                raise tester.with_last(what, self.message, None)
            if tester.mismatches(self.message, found[1]):
                raise tester.with_last(f"{self.message} is not as expected", self.message, found[1])
            tester.use(found[0])
            seen.append(found[1])
        return seen

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        measured = {
            "message": Key(shapes.frames.pattern, "which frame", needed=True),
            **EVERY,
            "tolerance": Key(DURATION, "by how much it may be off", needed=True),
            "count": Key(COUNT, "how many periods are measured", needed=True),
            "worst": Key(DURATION, "by how much one of them may be off"),
        }
        return ActionRow(yaml_shapes.record(Period, measured))


class Unheard(NamedTuple):
    """Fail if anyone but the tester has used this COB-ID since the suite began."""

    cob_id: int

    def __str__(self) -> str:
        return f"nothing on 0x{self.cob_id:03X}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        seen = [each for each in tester.trace.frames if each.frame.cob_id == self.cob_id and not each.own]
        if seen and (suite.Reported.HEARD, self.cob_id) in tester.reported:
            raise Skipped("it came again, and was red before")
        if seen:
            tester.reported.add((suite.Reported.HEARD, self.cob_id))
            what = f"{amount(len(seen), 'frame')} came with the identifier 0x{self.cob_id:03X}"
            raise Failed(what, "none", str(seen[0].frame))

    @staticmethod
    def row(_: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        identifier = yaml_shapes.within(NUMBER, Within(0, HIGHEST_IDENTIFIER), "identifier")
        return ActionRow(with_0x(3, identifier), Unheard)


class Save(NamedTuple):
    """Set variables to fields of the last received messages."""

    variables: Mapping[str, suite.FieldOf]

    def __str__(self) -> str:
        return f"save {', '.join(self.variables)}"

    async def run(self, tester: BenchTester) -> None:
        """Run the action; raises as `suite.StepAction.run`."""
        for name, (binding, field) in self.variables.items():
            frames = (each.frame for each in reversed(tester.trace.frames) if not each.own)
            last = next((frame for frame in frames if frame.cob_id == binding.cob_id), None)
            if last is None:
                raise Failed(f"no {binding.name} has come yet")
            tester.variables[name] = getattr(tester.decoder.protocol.decode(*last), field)

    @staticmethod
    def row(shapes: DocumentShapes) -> ActionRow:
        """Return the row for the table of actions."""
        return ActionRow(yaml_shapes.mapping(shapes.frames.field, NAME), Save)


def _row_of_one(pattern: Shape[Pattern]) -> ActionRow:
    return ActionRow(pattern, lambda one, **keys: Expect(Patterns(Order.IN_ORDER, (one,)), **keys), WITHIN)


ACTIONS = {
    "send": Send.row,
    "answer": Answer.row,
    "expect": Expect.row,
    "await": Await.row,
    "never": Never.row,
    "poll": Poll.row,
    "period": Period.row,
    "unheard": Unheard.row,
    "heartbeat": Expect.heartbeat,
    "emcy": Expect.emcy,
    "save": Save.row,
}
"""The actions of this module by key."""
