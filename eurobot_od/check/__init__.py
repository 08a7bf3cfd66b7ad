"""Scripted node checks: suites of steps in YAML, run against real or simulated nodes, for any EDS files.

From file to report:

    format    takes a file apart and finds the network it is for; all problems of all files become one error. By its
              tables of keys (and `shapes`) what stands in a suite becomes the values of `suite`, checked against the
              EDS files: after that nothing knows of YAML, and no step can be wrong in itself
    runner    does setup, steps and teardown on a bench, and gives a result for each step
    steps     the bench, and what each action does: it sends on it and looks at the trace
    report    results as text; it knows nothing of running

The bench is a bus with the nodes under test, real or simulated (`on_bus`). All it does is send frames and put
what the others send into the trace, in the order of the bus and with the time of the bus. A step never looks at
"now" to judge a frame, only at the time at which the frame came: so a late answer is late even if the step that waits
for it was slow to look, and the two benches give the same verdicts.
"""
