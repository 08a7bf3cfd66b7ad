"""Device profiles: what CiA 401 (I/O modules) and CiA 402 (drives) say about a device beyond CiA 301.

`cia401` and `cia402` are the standards as tables, and `words` says a value by them. `axis`, `motion`, `homing` and
`inputs_outputs` are the behaviour: they see their objects through `objects`, and know neither a bus nor a clock.
"""
