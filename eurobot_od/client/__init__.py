"""The master's side: networks and their nodes by name, for blocking programs and event loops.

`network` is what programs use. Below it, `remote_device` and `streams` are one node; `configure`, `lss` and
`program` are what is done with it, as procedures on a master (see `master`).

Rule of this package: every exception of canopen and python-can becomes one of ours. Nothing here prints; only
`Master.pump` waits.
"""
