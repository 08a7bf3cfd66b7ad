"""How devices of CiA 401 (I/O modules) and CiA 402 (drives) behave beyond CiA 301; the tables are in `od`.

`axis`, `modes` and `motion` are the behaviour: they see objects through `values`, and know neither a
bus nor a clock. `devices` makes simulated devices of them.
"""
