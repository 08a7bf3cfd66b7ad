"""The master's side: a network and its nodes by name, for programs that block and for event loops.

`network` has the faces that programs use; below it `remote_device`, `remote_objects`, `remote_pdos`, `emergencies` and
`streams` are one node, and `configure`, `scan`, `lss`, `program`, `history` what is done with it, as procedures (see
`procedure`) on a master (`master`, `masters`).

Rule of this package: every exception of canopen and python-can becomes one of ours. Nothing here prints; only
`Master.pump` waits.
"""
