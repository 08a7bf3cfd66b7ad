"""Node-IDs that LSS gives to the one device on a bus (CiA 305), and logs that begin after it."""

from __future__ import annotations

import pytest

from tests.pdo.test_in_force import AS_ANY, AS_MOTOR, BOOTED, MOTOR, OTHER, READ, SET, TAKEN, decoded, of_product

GLOBAL, STORE = "7E5#0401000000000000", "7E5#1700000000000000 7E4#1700000000000000"
BIT_RATE = "7E5#1300020000000000 7E4#1300000000000000 7E5#15E8030000000000"
MOTOR_ANSWERS = "605#4017100000000000 585#4B171000E8030000"
OTHER_ANSWERS = "606#4017100000000000 586#4B171000E8030000"
IDENTITY = "622#4018100100000000 5A2#4318100109000000 622#4018100200000000 5A2#4318100207000000"

ONE_DEVICE = {
    "the only file": (f"{GLOBAL} {SET} {TAKEN} {BOOTED}", [MOTOR], AS_MOTOR),
    "stored and with another bit rate": (f"{GLOBAL} {SET} {TAKEN} {BIT_RATE} {STORE} {BOOTED}", [MOTOR], AS_MOTOR),
    "of two files that of the device that was heard": (
        f"{MOTOR_ANSWERS} {GLOBAL} {SET} {TAKEN} {BOOTED}",
        [MOTOR, OTHER],
        AS_MOTOR,
    ),
    "both were heard": (f"{MOTOR_ANSWERS} {OTHER_ANSWERS} {GLOBAL} {SET} {TAKEN} {BOOTED}", [MOTOR, OTHER], AS_ANY),
    "none was heard": (f"{GLOBAL} {SET} {TAKEN} {BOOTED}", [MOTOR, OTHER], AS_ANY),
    "refused": (f"{GLOBAL} {SET} 7E4#1101000000000000 {BOOTED}", [MOTOR], AS_ANY),
    "another node boots up": (f"{GLOBAL} {SET} {TAKEN} 721#00", [MOTOR], AS_ANY),
    "the log begins after it, and the device says what it is": (IDENTITY, [MOTOR, OTHER], AS_MOTOR),
    "the log begins after it, and another device says what it is": (
        IDENTITY.replace("0207", "0206"),
        [MOTOR, OTHER],
        AS_ANY,
    ),
    "the log begins after it, and nobody says what it is": (BOOTED, [MOTOR], AS_ANY),
}


@pytest.mark.parametrize(("lines", "files", "expected"), ONE_DEVICE.values(), ids=ONE_DEVICE)
def test_a_node_id_set_globally_belongs_to_the_only_device(lines: str, files: list, expected: str) -> None:  # type: ignore[type-arg]
    assert decoded(f"{lines} {READ}", *files)[-1].text == expected


def test_a_file_for_the_new_node_id_has_priority() -> None:
    given = of_product("given", 34, product=1)
    assert decoded(f"{IDENTITY} {READ}", MOTOR, given)[-1].text == "given, read 0x1018:02 Identity, 2"
