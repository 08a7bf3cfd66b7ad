"""The pytest plugin with the robot's nodes, in runs of pytest of its own."""

from __future__ import annotations

import shutil
import signal
import threading
from importlib import import_module
from pathlib import Path

import can
import pytest

# What a run inside this process imports, pytester forgets; imported again, there would be two of each class.
USED = ("check.on_bus", "check.format", "check.report", "od.objects", "client.master", "device.simulated")
for module in (*USED, "robot.check", "robot.plugin", "bus.simulated.network"):
    import_module(f"eurobot_od.{module}")

pytest_plugins = ["pytester"]
PLUGIN = ("-p", "eurobot_od.pytest_plugin", "-p", "no:xdist", "-p", "no:cacheprovider")
EDS = Path(__file__).parents[2] / "eds" / "canopen"

SUITE = """\
spec: 1
name: the drive
node: drive
tags: [quick]
steps:
  - send: Check Drive Request
  - name: it answers
    expect: Check Drive Response
  - name: twice
    repeat: 2
    steps:
      - send: Goto State Request
      - expect: {Goto State Response: {time: TIME}}
  - name: the rest
    wait: 1 ms
"""
GREEN = SUITE.replace("TIME", "unknown")
RED = SUITE.replace("TIME", "5 ms")


def test_each_step_of_a_suite_is_a_test(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("drive.check.yaml").write_text(GREEN)
    result = pytester.runpytest_inprocess(*PLUGIN, "-v")
    result.assert_outcomes(passed=4)
    result.stdout.fnmatch_lines(["drive.check.yaml::the drive::2: it answers PASSED*"])


def test_a_red_step_says_what_was_expected_and_the_rest_is_skipped(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("drive.check.yaml").write_text(RED)
    result = pytester.runpytest_inprocess(*PLUGIN, "-rs")
    result.assert_outcomes(passed=2, failed=1, skipped=1)
    result.stdout.fnmatch_lines(
        [
            "twice 1/2: expect Goto State Response (line 13)",
            "*expected  Goto State Response: time 5 ms",
            "*came      Goto State Response  time=unknown",
            "*last frames*",
            "SKIPPED*is red, and ends the suite",
        ]
    )


def test_a_mistake_in_a_suite_is_an_error_of_collecting_with_its_place(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("drive.check.yaml").write_text(GREEN.replace("Check Drive Request", "Check Drive"))
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.assert_outcomes(errors=1)
    result.stdout.fnmatch_lines(["*drive.check.yaml:6:11: *Check Drive*"])


SUITES = ["drive.check.yaml", "drive.check.yml", "suite_drive.yaml", "suites/drive.yaml"]
OTHER_YAML = ["drive.yaml", "check_drive.yaml", "check.yaml", "docker-compose.yml"]


def test_only_files_that_opt_in_are_suites(pytester: pytest.Pytester) -> None:
    pytester.makeini("[pytest]\neurobot_suites = suite_*.yaml suites/*.yaml\n")
    pytester.mkdir("suites")
    for name in SUITES + OTHER_YAML:
        pytester.path.joinpath(name).write_text(GREEN)
    lines = pytester.runpytest_inprocess(*PLUGIN, "--collect-only", "-q").outlines
    assert sorted({each.partition("::")[0] for each in lines if "::" in each}) == sorted(SUITES)


def test_a_step_chosen_by_its_name_or_the_suite_s_tag_finds_the_suite_run(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("drive.check.yaml").write_text(GREEN)
    pytester.runpytest_inprocess(*PLUGIN, "-k", "answers").assert_outcomes(passed=1, deselected=3)
    pytester.runpytest_inprocess(*PLUGIN, "-k", "quick").assert_outcomes(passed=4)


NETWORKS = [
    # (file that is there, ini option, outcome)
    ("network.yaml", "eurobot_network = network.yaml", {"passed": 1}),
    ("eurobot-od.yaml", "", {"passed": 1}),
    ("network.yaml", "", {"errors": 1}),  # the robot has no motor
    ("eurobot-od.yaml", "eurobot_network = none.yaml", {"errors": 1}),
]


@pytest.mark.parametrize(("file", "option", "outcome"), NETWORKS)
def test_a_suite_may_be_for_any_network(
    pytester: pytest.Pytester, file: str, option: str, outcome: dict[str, int]
) -> None:
    shutil.copy(EDS / "drive.eds", pytester.path / "motor.eds")
    pytester.path.joinpath(file).write_text("nodes:\n  motor: {file: motor.eds, node_id: 5}\n")
    pytester.makeini(f"[pytest]\n{option}\n")
    suite = "spec: 1\nname: motor\nnode: motor\nsteps:\n  - sdo: {read: 0x1018:1, save: vendor}\n"
    pytester.path.joinpath("motor.check.yaml").write_text(suite)
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.assert_outcomes(**outcome)
    assert "Traceback" not in result.stdout.str()


def test_a_suite_with_a_dialect_has_its_files_whatever_the_network(pytester: pytest.Pytester) -> None:
    shutil.copy(EDS / "drive.eds", pytester.path / "motor.eds")
    pytester.path.joinpath("eurobot-od.yaml").write_text(
        "robot: eurobot2014\nnodes:\n  motor: {file: motor.eds, node_id: 5}\n"
    )
    suite = "spec: 1\nname: backwards\nnode: drive\ndialect: firmware2014\nsteps:\n  - send: {Goto XY: %s}\n"
    goto = "{x: 700, y: 1750, angle: 0, speed: 100, direction: backward}"  # a field that only that dialect has
    pytester.path.joinpath("drive.check.yaml").write_text(suite % goto)
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=1)


@pytest.mark.posix
def test_ctrl_c_ends_a_suite_with_its_teardown(pytester: pytest.Pytester) -> None:
    head = "spec: 1\nname: long\nnode: drive\n"
    steps = "steps: [{send: Stop Drive}, {wait: 1 min}]\nteardown: [{send: Check Drive Request}]\n"
    pytester.path.joinpath("long.check.yaml").write_text(head + steps)
    seen = []

    def press(message: can.Message) -> None:
        seen.append(message.arbitration_id)
        if len(seen) == 1:
            signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGINT)

    with can.Bus(interface="virtual", channel="ctrl-c") as bus:
        notifier = can.Notifier(bus, [press], timeout=0.01)
        with pytest.raises(KeyboardInterrupt):
            pytester.runpytest_inprocess(*PLUGIN, "--eurobot-interface", "virtual", "--eurobot-channel", "ctrl-c")
        notifier.stop()
        while message := bus.recv(0):
            seen.append(message.arbitration_id)
    assert seen == [0x004, 0x3C0]


def test_a_bus_that_cannot_be_opened_is_one_line(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("drive.check.yaml").write_text(GREEN)
    result = pytester.runpytest_inprocess(*PLUGIN, "--eurobot-interface", "nonsense", "-k", "answers")
    result.assert_outcomes(failed=1, deselected=3)
    result.stdout.fnmatch_lines(["cannot open the nonsense bus*"])


def test_the_fixture_runs_a_suite_beside_the_test_or_a_shipped_one(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("mine.yaml").write_text(GREEN)
    pytester.makepyfile(
        """
        def test_mine(eurobot_check):
            (result,) = eurobot_check("mine.yaml")
            assert result.name == "the drive"
        def test_fault(eurobot_check):
            eurobot_check("mine.yaml", faults=["state-not-answered"])
        def test_unknown(eurobot_check):
            eurobot_check("none")
        """
    )
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.assert_outcomes(passed=1, failed=2)
    result.stdout.fnmatch_lines(
        ["twice 1/2: expect Goto State Response (line 13)", "unknown suite 'none'; known: *drive*"]
    )


@pytest.mark.long
def test_the_plugin_imports_nothing_until_it_is_used(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("docker-compose.yaml").write_text("services: {}\n")
    pytester.makepyfile(
        """
        import sys

        def test_nothing_is_imported():
            ours = {each for each in sys.modules if each.startswith("eurobot_od")}
            of_package = {"eurobot_od", "eurobot_od.canopen_names", "eurobot_od.errors"}  # by any import of it
            assert ours == {*of_package, "eurobot_od.pytest_plugin"}
            assert not {"can", "canopen", "yaml", "asyncio"} & sys.modules.keys()
        """
    )
    pytester.runpytest_subprocess(*PLUGIN).assert_outcomes(passed=1)
