"""Random SDO requests: a short run against every node, and a judge that does find faults."""

from __future__ import annotations

from pathlib import Path

import pytest
import sdo_fuzz

from eurobot_od.od.dictionary import Dictionary
from tests.device import io_module
from tests.kit import plant

SAMPLES = Path(__file__).parents[1] / "lint" / "samples"
FOREIGN = [each for each in sorted(SAMPLES.iterdir()) if not each.name.startswith("broken_by_hand")]
FOREIGN += plant.FILES.folder().iterdir()


@pytest.mark.parametrize("file", FOREIGN)
def test_a_device_of_the_documentation_answers_by_the_standard(file: Path) -> None:
    assert sdo_fuzz.run(Dictionary.load(file, 5), requests=1500, seed=7) > 0


def test_a_device_with_values_of_all_types_answers_by_the_standard() -> None:
    assert sdo_fuzz.run(io_module.dictionary(), requests=5000, seed=7) > 0


UPLOAD = bytes.fromhex("4000100000000000")
WRONG = [
    (UPLOAD, [], "no answer"),
    (UPLOAD, ["4300100000"], "an answer of 5 bytes"),
    (UPLOAD, ["4301100000000000"], "another object"),
    (UPLOAD, ["6000100000000000"], "the answer to a download"),
    (UPLOAD, ["8000100000000206"], "an abort without a cause"),
    (UPLOAD, ["4300100000000000"] * 2, "two answers"),
    (bytes.fromhex("40ffff0000000000"), ["43ffff0000000000"], "a value of an object that is not there"),
    (bytes.fromhex("2300100000000000"), ["6000100000000000"], "an object written that is read-only"),
    (bytes.fromhex("2f01210105000000"), ["6001210100000000"], "a value too short taken"),
    (bytes.fromhex("e000100000000000"), ["6000100000000000"], "an answer to no command"),
    (bytes.fromhex("8000100000000000"), ["8000100000000000"], "an answer to an abort"),
    (bytes(5), ["8000000001000405"], "an answer to no request"),
]


@pytest.mark.parametrize(("request_data", "answers"), [row[:2] for row in WRONG])
def test_the_judge_finds_a_wrong_answer(request_data: bytes, answers: list[str]) -> None:
    with pytest.raises(sdo_fuzz.Fault):
        sdo_fuzz.Judge(plant.load("lift")).exchange(request_data, [bytes.fromhex(each) for each in answers])


def test_the_judge_misses_the_abort_of_a_silent_client() -> None:
    judge = sdo_fuzz.Judge(plant.load("lift"))
    judge.exchange(bytes.fromhex("4008100000000000"), [bytes.fromhex("4108100012000000")])
    with pytest.raises(sdo_fuzz.Fault):
        judge.silence([])
