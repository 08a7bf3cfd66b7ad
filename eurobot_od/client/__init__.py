"""The master's side: a network and its nodes by name, for programs that block and for event loops.

`network` is what programs use. Below it, `remote_device` and `streams` are one node; `configure`, `lss` and
`program` are what is done with it, as procedures on a master (see `master`).

Rule of this package: every exception of canopen and python-can becomes one of ours. Nothing here prints; only
`Master.pump` waits.
"""
