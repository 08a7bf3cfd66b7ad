"""What the page may ask for: each request is a row of a table, checked as the command line would check it.

Rule of this file: whatever comes from a browser is answered, and never raises. A request that acts on the bus, or on
this machine's disk, is done only if the server was started with control.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from functools import partial
from typing import Any

from eurobot_od.errors import EurobotError, LocalError, look_up
from eurobot_od.web.asking import Arguments, PageRequest, Way, read_request
from eurobot_od.web.desk import Desk
from eurobot_od.web.drives import LOOK, MayMove, MotionThread
from eurobot_od.web.views import checks, drives, files, layouts, nodes, objects, send, settings


def diagnosis(desk: Desk, _: Arguments) -> dict[str, Any]:
    """Return the diagnosis of the bus so far."""
    return desk.session.diagnosis.as_data(desk.session.now)


def record(desk: Desk, _: Arguments) -> None:
    """Begin to record."""
    desk.session.recording.start(desk.folder)


def stop_recording(desk: Desk, _: Arguments) -> None:
    """End the recording."""
    desk.session.recording.stop()


def end_job(desk: Desk, _: Arguments) -> None:
    """End the job that runs; it puts back what it has changed."""
    desk.jobs.end()


REQUESTS: Mapping[str, PageRequest] = {
    "record": PageRequest(record, Way.AT_ONCE, acts=True),
    "stop recording": PageRequest(stop_recording, Way.AT_ONCE, acts=True),
    "diagnosis": PageRequest(diagnosis, Way.AT_ONCE),
    "end job": PageRequest(end_job, Way.AT_ONCE, acts=True),
    **objects.REQUESTS,
    **checks.REQUESTS,
    **files.REQUESTS,
    **layouts.REQUESTS,
    **nodes.REQUESTS,
    **send.REQUESTS,
    **settings.REQUESTS,
    **drives.REQUESTS,
}


class Requests:
    """Answers the requests of browsers by means of the `desk`."""

    def __init__(self, desk: Desk) -> None:
        self.desk = desk

    async def answer(self, text: str, who: object = None) -> str:
        """Answer a browser's request, both as JSON; `asks` in an answer is a question.

        A request with `sure` that repeats the question as `confirmed` confirms it.
        """
        number: Any = None
        try:
            said = read_request(text)
            number = said.get("id")
            name = str(said.get("do"))
            asked = look_up("request", name[:40], REQUESTS)
            if asked.acts and not self.desk.control:
                raise LocalError("this page is read-only: start the server with --control")
            return json.dumps(
                {"re": number, "ok": await self._done(asked, {**said, "who": who, "stops": self.desk.stops})}
            )
        except MayMove as question:
            return json.dumps({"re": number, "error": f"not sent: {question}", "asks": str(question)})
        except (EurobotError, OSError) as error:
            return json.dumps({"re": number, "error": str(error)})

    async def _done(self, asked: PageRequest, said: Arguments) -> Any:
        do = partial(asked.function, self.desk, said)
        if asked.way is Way.AT_ONCE:
            return do()
        if asked.way is Way.ORDERS:
            return await do()
        if asked.way is Way.ASKS:
            return await self.desk.ask(do, str(said.get("node")))
        return await asyncio.to_thread(do)

    @asynccontextmanager
    async def running(self) -> AsyncIterator[None]:
        """Send what ends motions while this goes on; at its end whatever we have ordered is halted first."""
        motions = self.desk.drives
        with MotionThread(motions):
            try:
                yield
            finally:
                send.end_all(self.desk, "the server ends")
                motions.begin_end()
                await self.desk.jobs.wait()
                while not motions.may_end:
                    await asyncio.sleep(LOOK)
                await asyncio.to_thread(motions.put_back)

    def left(self, who: object) -> None:
        """Stop what somebody has ordered who is gone, and end what is sent again and again for them."""
        send.end_of(self.desk, who)
        self.desk.drives.left(who)
        self.desk.uploads.pop(who, None)

    def snapshot_data(self, since: int) -> dict[str, Any]:
        """Return what a snapshot says besides the session: what has changed after a turn."""
        desk = self.desk
        lists = {key: each.data() for key, each in desk.lists.items()}
        return {"control": desk.control, "motion": desk.drives.data(), "jobs": desk.jobs.data(since), "lists": lists}
