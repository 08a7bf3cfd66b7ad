"""Live operation on a python-can bus: the only package below the command line with threads and the real clock.

Theory of operation
===================

A `Live` has one bus, one controller, perhaps one node, and three threads. Programs add their own, which call
`Live.send` or methods of the node, such as `core.goto`.

- The **reader** (reader.py) waits for frames. It delivers each to the node and into the message queues, and sends the
  node's answer itself: to wake another thread for it takes as long as a frame on the bus. Functions of users do not run
  here; the reader only lines up their calls.
- The **function thread** (reader.py) makes these calls one after the other, in the order in which the messages came.
  A function that is slow or hangs delays other functions, and nothing else. The line is bounded: when it is full, the
  oldest call makes room, is counted for its listener and reported.
- The **keeper** (live.py) does everything that is due at a time: the node's timers, dropping frames that have waited
  too long for a mailbox, another try when the driver has not taken a frame, and a report of a function that does not
  return.

Locks
-----
*The lock* of a `Live` (it is also the node's `guard`) protects the node and the queue. A thread holds it to
compute, never while it waits for the bus, a driver, a function or a program. It is reentrant, as the node wakes the
keeper from within.

*The turn* to send is not a lock: no thread waits for it. A thread that has submitted a frame takes the turn if it is
free, and hands frames to the driver, the most urgent first, until none is left; the turn is given back, under the lock,
in the same step that finds none left. If the turn is taken, its owner sends the new frame as well. So a caller of
`send` waits neither for the bus nor for another caller, and no two threads are in the driver's `send` at once, which
few drivers allow.

Message queues and the line of calls have locks of their own, inside Python's SimpleQueue, held for a moment.

Who wakes whom
--------------
- A frame wakes the reader, by the driver's `recv`. It also returns every 0.1 s to see whether it is to end.
- The reader wakes whoever waits at a message queue, the function thread by lining up a call, and the keeper if the node
  has planned something sooner than the keeper would look.
- A program that calls the node (or sends where the driver might make it wait) wakes the keeper, which sends for it.
- The keeper wakes itself: when the next thing is due, and at least every 0.1 s.

When something fails
--------------------
A listener's exception ends in the controller, a node's in its station, which reports it, stops the node, and ends or
restarts it. A driver that fails is reported once. If a `Live` knows how to open the bus again, the reader does so after
growing pauses (buses.py). Until it is back, the queue keeps stops and nothing else, and the node is notified: a
drive brakes, a core gives up its goto. Without an opener reading ends with `Live.failure`. Sending is tried again
either way, so that a stop leaves when the driver is back. Ctrl-C may hit the thread that has the turn anywhere; it
gives the turn back, its frame stays loaded.
"""

from eurobot_od.bus.live.adapters import BITRATE as BITRATE
from eurobot_od.bus.live.adapters import here as here
from eurobot_od.bus.live.buses import Driver as Driver
from eurobot_od.bus.live.buses import Opener as Opener
from eurobot_od.bus.live.buses import is_named as is_named
from eurobot_od.bus.live.buses import open_bus as open_bus
from eurobot_od.bus.live.buses import share as share
from eurobot_od.bus.live.live import Live as Live
from eurobot_od.bus.live.reader import FrameReader as FrameReader
