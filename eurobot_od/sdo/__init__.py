"""Service data objects (CiA 301, 7.2.4): their frames, a server and a client, all without a bus.

One client asks one server for one object at a time. The client sends requests of 8 bytes under one COB-ID, the server
answers of 8 bytes under another. The first request names the object; what follows depends on its length:

- Expedited, up to 4 bytes: the value is in the first request, or in its answer.
- Segmented: the first request and its answer name the object, and usually its size. Then each request reads or writes
  7 bytes, and is answered. A toggle bit alternates, so that a repeated frame is detected. An empty object is also
  transferred this way, because an expedited transfer cannot have 0 bytes.
- Block: for long objects, see below. A server need not have it.

Either end may abort at any time, with a code for the reason; an abort is not answered. An abort may cross a frame on
the bus, and arrive during the next transfer. An SDO frame does not identify its transfer, so a client must wait for the
answer, or time out and abort, before its next request.

Block transfer
--------------
Up to 127 segments (a block) are sent at once and acknowledged together. Upload:

    client                                          server
    initiate: object, segments in a block     ->
                                              <-    initiate: size
    start                                     ->
                                              <-    segment 1 .. segment n, the last with its bit 7 set
    acknowledge: last in sequence, block size ->
                                              <-    the next block, or the end: unused bytes, CRC
    end                                       ->

In a download the roles are reversed: the server's answers have the size of the next block, the client sends the blocks
and the end, and the server confirms the end.

- A segment's first byte is its number in the block, from 1, and not a command, so that the meaning of a frame depends
  on earlier ones. Number 0 is never used, so that 0x80 is always an abort.
- Segments after a gap are dropped: only those in sequence are acknowledged, and the sender repeats from there,
  numbering from 1 again. A block ends by the number of its last segment, or by bit 7.
- A receiver does not notice that the end of a block was lost. Our server waits for the client until its time-out. Our
  client acknowledges the received segments after its time-out, and the server sends the rest; but not if no segment
  came, because the server may not have received the request.
- Every segment but the last one is full. The end has the number of unused bytes in the last segment; until then, a
  receiver may have up to 7 bytes more than the object has, and cannot refuse it as too long.
- The CRC (CCITT, start value 0) over the object's bytes detects a segment of an earlier block that was taken for one of
  this block. It is used if both ends offer it, as ours do.
"""

from eurobot_od.canopen_names import module_attribute
from eurobot_od.sdo import exceptions as exceptions
from eurobot_od.sdo.exceptions import SdoAbortedError as SdoAbortedError
from eurobot_od.sdo.exceptions import SdoCommunicationError as SdoCommunicationError

__getattr__ = module_attribute(__name__)
