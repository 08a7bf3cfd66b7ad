"""Conformance suites: what CiA 301 asks of a device, generated from the device's own EDS or DCF.

Theory of operation. `suite.text` writes suites in the YAML format of all suites, and the usual reader reads them. So a
generated suite can do no more than a written one, and a team may keep and edit its text. Each chapter (in `nmt`,
`objects`, `sdo`, `storage`, `pdo`, `broadcasts`) is a list of clauses of CiA 301. A function becomes a clause by
`@Clause(CHAPTER, ...)`, with the clause's number and topic, its tier, and what it needs in the file. It makes the steps
(`step`) from a `DeviceUnderTest`, which reads the file. The suites of device `profiles` are chapters, too. Clauses run
in the order of their file. Each step's name begins with the clause (`clauses.StepName`); a `page` reports a run by
these names, for the device's manufacturer, and by the numbers of CiA's own test tool.

Rules of this package:

- What the file lacks is skipped with the reason, never red. What the standard leaves open is open here.
- A step tests for the right behaviour and does not guess what is wrong; its name says which fault a device has.
- What is written is restored, and a write that must be refused writes the value that would do the least harm. Without
  `destructive` nothing is stored. Only communication objects under test get other values, for as long as they are
  tested: the heartbeat time, a PDO's record and a TPDO's transmission.
- Steps depend on each other within a group only, so that one fault makes few steps red.
"""
