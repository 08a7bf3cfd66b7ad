"""The interop matrix: each program with its questions.

To add a question, add a row here and a function in a module beside this one.
"""

from __future__ import annotations

from interop_rows import (
    conformance,
    databases,
    exports,
    javascript,
    mixed_bus,
    peers,
    recordings,
    shared_bus,
    sheets,
    tools,
    variables,
)
from interop_rows.row import Row

ROWS = (
    Row(tools.DCF_TOOLS, "dcfchk: check every EDS and a DCF", sheets.check_files),
    Row(tools.DCF_TOOLS, "dcfgen: make a slave's concise DCF", sheets.generate_concise_dcf),
    Row(tools.DCF_TOOLS, "dcfchk, dcfgen: take the documentation's devices", sheets.check_examples),
    Row(tools.DCF_TOOLS, "dcfgen: a bus.yml, and ours of the same", sheets.generate_networks),
    Row(tools.DCF_TOOLS, "dcf2dev: make C of every EDS", sheets.generate_c_device),
    Row(tools.OBJDICTGEN, "odg list: list every EDS", sheets.odg_list),
    Row(tools.OBJDICTGEN, "odg list: the documentation's devices", sheets.list_examples),
    Row(tools.OBJDICTGEN, "odg convert: every EDS to .od and back", sheets.odg_round_trip),
    Row(tools.CANOPEN, "as master: SDO, EDS upload, blocks", peers.sdo_by_stock_master),
    Row(tools.CANOPEN, "as master: NMT, heartbeat, EMCY", peers.services_by_stock_master),
    Row(tools.CANOPEN, "as master: pdo.read, pdo.save", peers.pdos_by_stock_master),
    Row(tools.CANOPEN, "as master: pdo.export through canmatrix", peers.export_by_stock_master),
    Row(tools.CANOPEN, "PDO variables: read and write every message", variables.by_stock_pdos),
    Row(tools.CANOPEN, "as node of our master", peers.stock_node_under_our_master),
    Row(tools.CANOPEN, "as node: the conformance suite of its file", conformance.of_stock_node),
    Row(tools.CANTOOLS, "read our DBC files", databases.by_cantools),
    Row(tools.CANMATRIX, "read our DBC files", databases.by_canmatrix),
    Row(tools.GCC, "compile our C headers, pack and unpack", exports.by_compiler),
    Row(tools.CAN, "Logger: record a session in each format", recordings.written_by_python_can),
    Row(tools.CAN, "LogReader: read `match --log` in each format", recordings.read_by_python_can),
    Row(tools.CAN, "can_player: play a log to our drive", shared_bus.played_log),
    Row(tools.REMOTE, "carry a bus between master and node", shared_bus.remote_bus),
    Row(tools.TSHARK, "dissect a recorded session", recordings.dissected_by_tshark),
    Row(tools.TSHARK, "name the frames of a bus with devices of several makers", mixed_bus.named_by_tshark),
    Row(tools.TSHARK, "dissect with our dissectors", exports.by_tshark),
    Row(tools.NPM_CANOPEN, "load every EDS", javascript.load),
    Row(tools.NPM_CANOPEN, "as master: SDO, NMT, heartbeat, EMCY", javascript.talk),
    Row(tools.CAN_UTILS, "cansend and candump on vcan0", shared_bus.candump_and_cansend),
)
