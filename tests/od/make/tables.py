"""A small protocol table: two nodes, two dialects."""

from __future__ import annotations

TABLE = """\
file: {version: 1, revision: 0, time: "12:00PM", date: "05-28-2014", author: somebody}
vendor: {name: Somebody, number: 0}
serial_number: 1
hardware_version: "1"
software_version: "1.0"
bit_rate: 500
bit_rates: [500]
heartbeat: 1000
heartbeat_timeout: 2000
nodes:
  core: &core
    node_id: 1
    product_name: Core
    product_number: 1
    order_code: CORE
    watches: [drive]
    communication_error: 1
    settings: {Wait: {index: 0x2101, fields: {Check wait: {bits: 16, range: [1, 0xFFFF], default: 9, unit: ms}}}}
  drive:
    node_id: 2
    product_name: Drive
    product_number: 2
    order_code: DRIVE
    watches: []
    communication_error: 0
    settings: {}
settings: {Node: {index: 0x2100, fields: {Node-ID: {bits: 8, range: [1, 127], default: $NODEID}}}}
objects:
  Target:
    index: 0x2000
    fields:
      X position: {bits: 12, range: [0, 3000], codes: {unknown: 0xFFF}, default: unknown, unit: mm}
      Speed: {bits: 8, range: [0, 100], default: 0}
  Long:
    index: 0x2001
    fields:
      First half: {bits: 32, range: [0, 1], default: 0}
      Second half: {bits: 32, range: [0, 1], default: 0}
      One bit: {bits: 1, range: [0, 1], default: 0}
messages:
  Goto:
    {identifier: 8, priority: high, senders: [core], receivers: [drive], object: Target}
  Confirm: {identifier: 12, senders: [drive], receivers: [core]}
dialects:
  plain: {revision_number: 0x00010000}
  other: {revision_number: 0x00020000, widths: {Target: {Speed: 7}}, most_significant_first: [Target]}
"""
