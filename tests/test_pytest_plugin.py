"""The pytest plugin, in runs of pytest of its own."""

from __future__ import annotations

import re
import shutil
from importlib import import_module

import pytest

from tests.kit.devices import MOTOR

# What a run inside this process imports, pytester forgets; imported again, there would be two of each class.
USED = ("check.on_bus", "check.format", "check.report", "od.objects", "client.master", "device.simulated")
for module in (*USED, "bus.simulated.network"):
    import_module(f"eurobot_od.{module}")

pytest_plugins = ["pytester"]
PLUGIN = ("-p", "eurobot_od.pytest_plugin", "-p", "no:xdist", "-p", "no:cacheprovider")


def test_a_suite_is_for_the_network_of_the_folder(pytester: pytest.Pytester) -> None:
    shutil.copy(MOTOR, pytester.path)
    pytester.path.joinpath("eurobot-od.yaml").write_text("nodes:\n  motor: {file: motor.eds, node_id: 5}\n")
    suite = "spec: 1\nname: motor\nnode: motor\nsteps:\n  - sdo: {read: 0x1018:1, save: vendor}\n"
    pytester.path.joinpath("motor.check.yaml").write_text(suite)
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=1)


def test_a_robot_that_only_a_file_names_is_left_out_with_a_warning(pytester: pytest.Pytester) -> None:
    folder = pytester.mkdir("somebodys")
    (folder / "robot.py").write_text("from pathlib import Path\nPath('it ran').touch()\n")
    shutil.copy(MOTOR, pytester.path)
    nodes = "nodes:\n  motor: {file: motor.eds, node_id: 5}\n"
    pytester.path.joinpath("eurobot-od.yaml").write_text(f"robot: ./somebodys\n{nodes}")
    suite = "spec: 1\nname: motor\nnode: motor\nsteps:\n  - sdo: {read: 0x1000}\n"
    pytester.path.joinpath("motor.check.yaml").write_text(suite)
    result = pytester.runpytest_inprocess(*PLUGIN, "-W", "always")
    result.assert_outcomes(passed=1)
    result.stdout.fnmatch_lines(["*RobotWarning: *to run it, set EUROBOT_OD_ROBOT, or type --robot *somebodys*"])
    assert not pytester.path.joinpath("it ran").exists()


def test_help_has_the_options_under_a_heading_of_their_own(pytester: pytest.Pytester) -> None:
    result = pytester.runpytest_inprocess(*PLUGIN, "--help")
    result.stdout.fnmatch_lines(["CANopen nodes and check suites:", "*--eurobot-interface=*"])


def test_fixtures_reach_a_device_and_a_simulated_network(pytester: pytest.Pytester) -> None:
    shutil.copy(MOTOR, pytester.path)
    pytester.makepyfile(
        """
        import pytest
        from eurobot_od import SimulatedDevice
        from eurobot_od.errors import FieldError

        def test_node(eurobot_node):
            motor = eurobot_node("motor.eds", node_id=5)
            motor["Producer heartbeat time"].value = 40
            assert motor["0x1017"].value == 40
            assert motor.heartbeat(within=2.0).name == "PRE_OPERATIONAL"
            with pytest.raises(FieldError):
                motor["0x1017"].value = 70000

        def test_network(eurobot_network):
            seen = []
            simulation = eurobot_network.simulation
            simulation.observers.append(lambda now, frame: seen.append(str(frame)))
            simulation.attach(SimulatedDevice.load("motor.eds", node_id=5))
            eurobot_network.sleep(1.0)
            assert "705#00" in seen
        """
    )
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=2)


def test_a_bus_of_a_test_is_of_that_test_alone(pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("CAN_INTERFACE", "virtual")  # as somebody has who needs no options elsewhere
    pytester.makepyfile(
        """
        import can

        def test_bus(eurobot_bus):
            one, other = eurobot_bus(), eurobot_bus()
            with can.Bus() as foreign:
                one.send(can.Message(arbitration_id=1))
                assert other.recv(0) is not None
                assert foreign.recv(0) is None
        """
    )
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=1)


def test_the_fixture_of_the_page_runs_with_the_file_beside_it(pytester: pytest.Pytester) -> None:
    page = (MOTOR.parent / "checks.md").read_text(encoding="utf-8")
    shown = re.findall(r"^def test_the_motor.*?^```", page, re.MULTILINE | re.DOTALL)[0].removesuffix("```")
    shutil.copy(MOTOR, pytester.path)
    pytester.makepyfile(shown)
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=1)


WRONG = {
    "a channel without its interface": (
        "",
        ["--eurobot-channel", "can0"],
        "--eurobot-channel needs --eurobot-interface",
    ),
    "a bit rate without its interface": ("", ["--eurobot-bitrate", "500000"], "--eurobot-bitrate needs --eurobot-int"),
    "a misspelt key": ("eurobot_suite = bench/*.yaml", [], "unknown key 'eurobot_suite'; did you mean eurobot_suites?"),
}


@pytest.mark.parametrize(("ini", "words", "said"), WRONG.values(), ids=WRONG)
def test_a_setting_that_cannot_count_ends_the_run(
    ini: str, words: list[str], said: str, pytester: pytest.Pytester
) -> None:
    pytester.makeini(f"[pytest]\n{ini}\n")
    result = pytester.runpytest_inprocess(*PLUGIN, *words)
    assert result.ret == pytest.ExitCode.USAGE_ERROR
    result.stderr.fnmatch_lines([f"*{said}*"])


SUITE = "spec: 1\nname: motor\nnode: motor\nsteps:\n  - sdo: {read: 0x1000}\n"


def test_a_pattern_of_suites_counts_from_the_folder_of_pytest(
    pytester: pytest.Pytester, monkeypatch: pytest.MonkeyPatch
) -> None:
    bench = pytester.mkdir("bench")
    shutil.copy(MOTOR, bench)
    (bench / "bench").mkdir()
    (bench / "bench" / "own.yaml").write_text(SUITE)
    (bench / "network.yaml").write_text("nodes:\n  motor: {file: motor.eds, node_id: 5}\n")
    (bench / "pytest.ini").write_text(
        "[pytest]\neurobot_suites = bench/*.yaml *.yaml\neurobot_network = network.yaml\n"
    )
    monkeypatch.chdir(bench)
    pytester.runpytest_inprocess(*PLUGIN).assert_outcomes(passed=1)


def test_a_suite_named_as_an_argument_needs_no_pattern(pytester: pytest.Pytester) -> None:
    shutil.copy(MOTOR, pytester.path)
    (pytester.path / "own.yaml").write_text(SUITE)
    (pytester.path / "network.yaml").write_text("nodes:\n  motor: {file: motor.eds, node_id: 5}\n")
    pytester.makeini("[pytest]\neurobot_network = network.yaml\n")
    pytester.runpytest_inprocess(*PLUGIN, "own.yaml").assert_outcomes(passed=1)
    assert pytester.runpytest_inprocess(*PLUGIN).ret == pytest.ExitCode.NO_TESTS_COLLECTED


MISUSES = {
    "a parameter of another name": (
        'eurobot_check("drive", fault="stop-ignored")',
        "*eurobot_check(file, faults=(), seed=1): *'fault'",
    ),
    "... of a node": ('eurobot_node("motor.eds", id=5)', "*eurobot_node(file, node_id=None): *'id'"),
    "a suite that is not there": (
        'eurobot_check("drives.yaml")',
        "unknown suite, neither *'drives'; did you mean drive?",
    ),
}


@pytest.mark.parametrize(("call", "said"), MISUSES.values(), ids=MISUSES)
def test_a_fixture_that_is_called_wrongly_says_how(call: str, said: str, pytester: pytest.Pytester) -> None:
    pytester.makepyfile(f"def test_it(eurobot_check, eurobot_node):\n    {call}\n")
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.assert_outcomes(failed=1)
    result.stdout.fnmatch_lines([said])
    assert "During handling" not in result.stdout.str()


def test_a_suite_for_devices_that_nothing_names_says_how_to_name_them(pytester: pytest.Pytester) -> None:
    pytester.path.joinpath("own.check.yaml").write_text(SUITE)
    result = pytester.runpytest_inprocess(*PLUGIN)
    result.stdout.fnmatch_lines(["*unknown node 'motor'; *", "*for other devices, name*: eurobot_network*"])
