"""Scripted node checks: suites of steps in YAML, run against real or simulated nodes, for any EDS files.

From file to report:

    format    reads a file and finds the network it is for; one error lists the problems of all files. Its tables of
              keys (with `shapes`) turn a suite into the values of `suite`, checked against the EDS files. Nothing
              after that knows of YAML, and every step is valid
    runner    does setup, steps and teardown on a bench, and returns a result for each step
    steps     does one action after the other; `actions` say what each one sends and expects
    report    formats results; it knows nothing of running

The bench (`bench`, `on_bus`) is a bus with the nodes under test, real or simulated. It only sends frames and records
the frames of the others in the trace, in the order of the bus and with their times. A step judges a frame by the time
at which it came, never by the time at which the step looks. So a late answer is late even if the step was slow to
look, and both benches give the same verdicts.
"""
