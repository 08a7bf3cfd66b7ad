"""Conformance suites: what CiA 301 asks of a device, made from the device's own EDS or DCF.

Theory of operation. `suite.text` writes suites in YAML, in the format of all others, and the reader reads them: what a
generated suite can do, a written one can do, too, and a team may keep the text and edit it. Each chapter (in `nmt`,
`objects`, `sdo`, `storage`, `pdo`, `broadcasts`) is a list of CiA 301's clauses: a function is entered by
`@Clause(CHAPTER, ...)` with the clause, its topic, what it may cost and what it needs of the file, and makes the steps
(`step`) from the `Subject`, which is what the file says. The suites of device `profiles` are chapters as well. Clauses
are run in the order of the file. The name of each step begins with the clause (`clauses.StepName`), by which a `page`
reports a run: for the device's maker, and by the numbers of CiA's own test tool.

Rules of this package:
- What the file does not have is skipped with the reason, never red. What the standard leaves open is open here.
- A step asks for what is right, it does not guess what is wrong: the step's name says which fault a device has.
- What is written is put back, and a write that has to be refused writes what would do the least harm. Without
  `destructive` nothing is stored, and no object gets another value but those of the communication that is checked: the
  heartbeat time, a PDO's record and the transmission of a TPDO, each for as long as it is looked at.
- Nothing depends on the step before but within a group, so that one fault makes few steps red.
"""
