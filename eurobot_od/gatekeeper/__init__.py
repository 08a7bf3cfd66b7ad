"""The CAN gatekeeper (document sections 4 and 6): who hears which message, and which frame leaves next.

How the document's wishes are met:

- *Listeners* (section 4.1). `setQueueCANListener` is `Gatekeeper.add_queue`, `setFunctionCANListener` is
  `add_function`. Listeners are registered before the start, in a table that may be bounded as in the 2014 robot; one
  that does not fit is an error with its name, and not lost silently.
- *Hardware filters* (section 6). The robot had to keep its listener table for ever, as its filters were an index into
  it. Here `Gatekeeper.filters` makes the filters from the routes whenever a bus wants them, and the bus keeps them.
- *Transmit-complete interrupt* (section 6). Nothing waits for a mailbox and nothing polls one: a frame is submitted to
  `Mailboxes`, and `complete`, which an interrupt would call, makes room for the next one.

Rule of this package: it opens no bus, starts no thread and reads no clock of its own accord; `bus/live` and
`bus/simulated` bring the frames, the time and the threads. Only a program that reads a `MessageQueue` may wait, for as
long as it says.
"""

from eurobot_od.gatekeeper.gatekeeper import Gatekeeper as Gatekeeper
from eurobot_od.gatekeeper.gatekeeper import Statistics as Statistics
from eurobot_od.gatekeeper.listeners import Event as Event
from eurobot_od.gatekeeper.listeners import FunctionListener as FunctionListener
from eurobot_od.gatekeeper.listeners import ListenerStatistics as ListenerStatistics
from eurobot_od.gatekeeper.listeners import MessageQueue as MessageQueue
from eurobot_od.gatekeeper.listeners import Received as Received
from eurobot_od.gatekeeper.listeners import Report as Report
from eurobot_od.gatekeeper.listeners import Reporter as Reporter
from eurobot_od.gatekeeper.mailboxes import Mailboxes as Mailboxes
from eurobot_od.gatekeeper.mailboxes import Stay as Stay
from eurobot_od.gatekeeper.mailboxes import TransmitStatistics as TransmitStatistics
