"""The CAN gatekeeper (document sections 4 and 6): who hears which message, and which frame leaves next.

Rule of this file: names only. Nothing in this package opens a bus, starts a thread or waits, but for a user who waits
at a message queue; the runtime brings the frames, the time and the threads.
"""

from eurobot_od.gatekeeper.gatekeeper import Gatekeeper as Gatekeeper
from eurobot_od.gatekeeper.gatekeeper import Running as Running
from eurobot_od.gatekeeper.gatekeeper import Statistics as Statistics
from eurobot_od.gatekeeper.listeners import FunctionListener as FunctionListener
from eurobot_od.gatekeeper.mailboxes import Mailboxes as Mailboxes
from eurobot_od.gatekeeper.mailboxes import TransmitStatistics as TransmitStatistics
from eurobot_od.gatekeeper.queues import ListenerStatistics as ListenerStatistics
from eurobot_od.gatekeeper.queues import MessageQueue as MessageQueue
from eurobot_od.gatekeeper.queues import Received as Received
from eurobot_od.gatekeeper.reports import Event as Event
from eurobot_od.gatekeeper.reports import Report as Report
