"""Recorded traffic: log files to frames, frames to meanings, meanings to text, JSON lines and CSV.

There is one path for every log and every form of output (`decoding`):

    line or object  ->  entry: number, time, channel, Raw   `formats`, `entries`
    Raw             ->  Meaning: message or service, text, defects   `meaning`, `services`, `transfers`
    Meaning         ->  row, the part of a line that the frame alone decides   `decoding`
    entry and row   ->  line

Beside it are what counts (`statistics`, `monitor`), compares, filters and records traffic, and what is proved of its
response times (`load`).

Rule of this package: what a frame means depends only on the frame, and on what frames before it have shown of the
devices. So a log may start anywhere, the meaning of a frame may be kept until it comes again, and memory does not grow
with the log. Nothing is dropped: what cannot be read, or is not a frame of the protocol, becomes an entry with its
Damage and is counted (`meaning.DamageCounts`).
"""
