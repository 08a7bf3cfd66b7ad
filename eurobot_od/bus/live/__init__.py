"""Live operation on a python-can bus: the only package below the command line with threads and the real clock.

Theory of operation
===================

A `Live` has one bus, one controller, perhaps one node, and three threads. Programs add their own, which call
`Live.send` or methods of the node, such as `core.goto`.

- The **reader** (reader.py) waits for frames. It delivers each to the node and to the message queues, and sends the
  node's answer itself, because waking another thread takes as long as a frame on the bus. It only queues the calls of
  users' functions.
- The **function thread** (reader.py) makes these calls one after the other, in the order of the messages. A function
  that is slow or hangs delays only other functions. The queue is bounded: when it is full, the oldest call is dropped,
  counted for its listener and reported.
- The **keeper** (live.py) does everything at its time: the node's timers, dropping frames that have waited too long for
  a mailbox, retrying frames that the driver has not accepted, and reporting a function that does not return.

Locks
-----
*The lock* of a `Live` (it is also the node's `guard`) protects the node and the queue. A thread holds it to
compute, never while it waits for the bus, a driver, a function or a program. It is reentrant, as the node wakes the
keeper from within.

*The turn* to send is not a lock: no thread waits for it. A thread that has submitted a frame takes the turn if it is
free, and passes frames to the driver, by priority, until none is left; it returns the turn, under the lock, in the step
that finds none left. If another thread has the turn, that thread sends the new frame. So a caller of `send` waits
neither for the bus nor for another caller, and never are two threads in the driver's `send`, which few drivers allow.

Message queues and the queue of calls have their own locks, inside Python's SimpleQueue, held for a moment.

Who wakes whom
--------------
- A frame wakes the reader, by the driver's `recv`. The reader also checks every 0.1 s whether it has to end.
- The reader wakes the threads that wait at a message queue, the function thread by queueing a call, and the keeper if
  the node has planned something earlier than the keeper's next check.
- A program that calls the node (or sends although the driver might block) wakes the keeper, which sends for it.
- The keeper wakes itself when the next action is due, and at least every 0.1 s.

When something fails
--------------------
The controller catches a listener's exception; the station catches a node's, reports it, stops the node, and ends or
restarts it. A failure of the driver is reported once. If the `Live` has an opener, the reader reopens the bus after
growing pauses (buses.py). Until then, the queue keeps only stop messages, and the node is notified, so that for example
a drive brakes. Without an opener, reading ends with `Live.failure`. Sending is retried in both cases, so that a stop is
sent when the driver works again. Ctrl-C may interrupt the thread with the turn anywhere; the turn is then returned, and
the frame stays queued.
"""

from eurobot_od.bus.live.adapters import BITRATE as BITRATE
from eurobot_od.bus.live.adapters import here as here
from eurobot_od.bus.live.buses import Driver as Driver
from eurobot_od.bus.live.buses import Opener as Opener
from eurobot_od.bus.live.buses import is_named as is_named
from eurobot_od.bus.live.buses import named as named
from eurobot_od.bus.live.buses import open_bus as open_bus
from eurobot_od.bus.live.buses import share as share
from eurobot_od.bus.live.buses import transmit as transmit
from eurobot_od.bus.live.live import Live as Live
from eurobot_od.bus.live.reader import FrameReader as FrameReader
