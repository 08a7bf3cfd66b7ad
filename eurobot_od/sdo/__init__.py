"""Service data objects (CiA 301, 7.2.4): their frames, a server and a client, all without a bus.

One client asks one server for one object at a time. The client sends requests of 8 bytes under one COB-ID, the server
answers of 8 bytes under another. The first request names the object; what follows depends on its length:

- Expedited, up to 4 bytes: the value is in the first request, or in its answer, and that is all.
- Segmented: the first request and its answer only agree on the object, and usually on its size. Then each request takes
  or brings 7 bytes, and each is answered. A toggle bit alternates, so that a frame heard twice is noticed. An object
  without any bytes goes this way, too: an expedited transfer cannot say "none".
- Block: for long objects, see below. A server need not have it.

Either end may abort at any time, with a code that says why (`aborts` has our own); an abort is not answered. An abort
may cross a frame on the wire, and reach an end that has begun something new. Nothing in an SDO frame says which
transfer it belongs to, so a client must not ask twice before it has the answer, or has waited its time and aborted.

How a block transfer goes
-------------------------
It saves answers: up to 127 segments (a block) are sent at once and acknowledged together. Upload:

    client                                          server
    initiate: object, segments in a block     ->
                                              <-    initiate: size
    start                                     ->
                                              <-    segment 1 .. segment n, the last with its bit 7 set
    acknowledge: last in sequence, block size ->
                                              <-    the next block, or the end: unused bytes, CRC
    end                                       ->

In a download the roles are reversed: the server gives the size of the next block in its answers, the client sends the
blocks and the end, and the server confirms the end.

- A segment's command byte is its number in the block, from 1. It has no command, so at both ends the meaning of a frame
  follows from what came before. Number 0 is never used, so that 0x80 is an abort even here.
- What arrives after a gap is dropped: only the first segments in sequence are acknowledged, and the sender goes on
  after them, numbering from 1 again. The block ends where its sender says so, by its number or by bit 7.
- If the end of a block is lost, its receiver does not know that. As a server we wait for the client, and give up after
  our time-out. As a client we acknowledge what came once the time is over, and the server sends the rest; but not if
  nothing came, as the server may then not know that it has to send this block.
- Every segment but the very last one is full. Only the end tells how many of the last one's 7 bytes are unused; until
  then a receiver may have up to 7 bytes more than the object has, and cannot yet say "too long".
- The CRC (CCITT, start value 0) is over the object's bytes and finds what the numbers cannot: a segment of an earlier
  block that was taken for one of this block. It is used if both ends offer it, as ours do.
"""
