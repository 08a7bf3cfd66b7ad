"""How devices of CiA 401 (I/O modules) and CiA 402 (drives) behave beyond CiA 301; the tables are in `od`.

`axis`, `modes` and `motion` are a drive's behaviour: they see objects through `AxisValues`, and know neither a bus nor
a clock. `devices` has that of inputs and outputs, and makes simulated devices of all of them.
"""
