"""The sizes of a Parquet file's pages, as their headers say them: what its columns take when they are unpacked.

A footer may say anything; a page is unpacked to the size in its own header (parquet-format, "Data Pages"). The headers
are structs of Thrift's compact protocol.
"""

from __future__ import annotations

import mmap
from collections.abc import Iterator
from pathlib import Path

import pyarrow.parquet as pq

UNPACKED, PACKED = 2, 3
"""Fields of a page's header: its size unpacked and packed."""

TRUE, FALSE, BYTE, I16, I32, I64, DOUBLE, BINARY, STRUCT = 1, 2, 3, 4, 5, 6, 7, 8, 12
"""Types of Thrift's compact protocol that a page's header has."""

MOST_BITS = 63
"""After so many bits no number goes on."""

LENGTHS = {TRUE: 0, FALSE: 0, BYTE: 1, DOUBLE: 8}


def unpacked(file: Path, footer: pq.FileMetaData) -> list[int]:
    """Return the unpacked bytes of each column of each row group.

    Raises LookupError or ValueError for a header that cannot be read, OSError.
    """
    groups = map(footer.row_group, range(footer.num_row_groups))
    columns = [each.column(n) for each in groups for n in range(each.num_columns)]
    with file.open("rb") as opened, mmap.mmap(opened.fileno(), 0, access=mmap.ACCESS_READ) as data:
        return [sum(_pages(data, each)) for each in columns]


def _pages(data: mmap.mmap, column: pq.ColumnChunkMetaData) -> Iterator[int]:
    """Yield the unpacked bytes of each page of a column."""
    at = min(filter(None, (column.dictionary_page_offset, column.data_page_offset)))
    end = at + column.total_compressed_size
    while at < end:
        header, at = _struct(data, at)
        if min(header[UNPACKED], header[PACKED]) < 0:
            raise ValueError("a page of less than nothing")
        yield header[UNPACKED]
        at += header[PACKED]


def _struct(data: mmap.mmap, at: int) -> tuple[dict[int, int], int]:
    """Return the numbers of a struct by their fields, and where it ends."""
    numbers: dict[int, int] = {}
    field = 0
    while head := data[at]:
        at += 1
        if head >> 4:
            field += head >> 4
        else:
            field, at = _signed(data, at)
        kind = head & 0xF
        if kind in (I16, I32, I64):
            numbers[field], at = _signed(data, at)
        elif kind == BINARY:
            length, at = _number(data, at)
            at += length
        elif kind == STRUCT:
            _, at = _struct(data, at)
        else:
            at += LENGTHS[kind]
    return numbers, at + 1


def _number(data: mmap.mmap, at: int) -> tuple[int, int]:
    """Return a number of 7 bits a byte, the lowest first, and where it ends."""
    number = shift = 0
    while (byte := data[at]) & 0x80 and shift < MOST_BITS:
        number |= (byte & 0x7F) << shift
        shift += 7
        at += 1
    return number | byte << shift, at + 1


def _signed(data: mmap.mmap, at: int) -> tuple[int, int]:
    """Return a number whose lowest bit is its sign, and where it ends."""
    number, at = _number(data, at)
    return number >> 1 ^ -(number & 1), at
