"""Recorded traffic: log files to frames, frames to meanings, meanings to text, JSON lines and CSV.

There is one path for every log and every form of output (`decoding`), an entry at a time:

    line or object  ->  entry: number, time, channel, Raw   `formats`
    Raw             ->  Meaning: message or service, text, defects   `meaning`, `services`
    Meaning         ->  row, the part of a line that the frame alone decides   `output`
    entry and row   ->  line

Rule of this package: what a frame means depends only on the frame. So a log may start anywhere, the meaning and the row
of a frame may be kept until it comes again, and memory does not grow with the log. Nothing is dropped: what cannot be
read, or is not a frame of the protocol, becomes an entry with its Damage and is counted (`meaning.DamageCounts`).
"""
