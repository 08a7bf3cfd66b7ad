"""Any bytes of a device's texts, octets and files are in its DCF, and make another device like it."""

from __future__ import annotations

import tempfile
from pathlib import Path

from hypothesis import given
from hypothesis import strategies as st

from eurobot_od.client.configure import dcf_of_node, difference, read_back
from eurobot_od.device.device import Device
from eurobot_od.od.dictionary import Dictionary
from eurobot_od.od.values import DOMAIN, OCTET_STRING, UNICODE_STRING, VISIBLE_STRING, Address
from tests.client.wired import agree_on_parameters, started, wired
from tests.properties.test_normal import File, files

NODE_ID = 5
TYPES = (VISIBLE_STRING, UNICODE_STRING, OCTET_STRING, DOMAIN)
OBJECTS: dict[Address, int] = {(0x2000 + number, 0): type_.code for number, type_ in enumerate(TYPES)}

HEAD = """\
[FileInfo]
FileName=any.eds
[MandatoryObjects]
SupportedObjects=2
1=0x1000
2=0x1018
[OptionalObjects]
SupportedObjects=0
[ManufacturerObjects]
SupportedObjects=0
[1000]
ParameterName=Device type
DataType=7
AccessType=ro
DefaultValue=0
[1018]
ParameterName=Identity
ObjectType=9
SubNumber=2
[1018sub0]
ParameterName=Highest sub-index
DataType=5
AccessType=const
DefaultValue=1
[1018sub1]
ParameterName=Vendor-ID
DataType=7
AccessType=ro
DefaultValue=1
"""
EDS = HEAD + "".join(
    f"[{index:04X}]\nParameterName=Any\nDataType={code}\nAccessType=rw\n" for (index, _), code in OBJECTS.items()
)

texts = st.text(max_size=300)
contents = st.one_of(
    st.binary(max_size=300),
    texts.map(lambda text: text.encode(errors="replace")),
    texts.map(lambda text: text.encode("utf-16-le", errors="replace")),
)


@given(st.tuples(*[contents] * len(TYPES)), st.sampled_from(["", "; €\n", "; \xfc\n"]))
def test_a_device_s_dcf_makes_another_like_it(each: tuple[bytes, ...], comment: str) -> None:
    wanted = dict(zip(OBJECTS, each))
    eds = (EDS + comment).encode("latin-1" if comment == "; \xfc\n" else "utf-8")
    with tempfile.TemporaryDirectory() as folder:
        dictionary = Dictionary.read(eds, Path(folder) / "any.eds", NODE_ID)
        one, other = (wired(started(Device(dictionary))).node(NODE_ID) for _ in range(2))
        for address, data in wanted.items():
            one.download(address, data)
        made, left_out, _ = dcf_of_node(one, dictionary, 500, "any")
        assert left_out == []
        for name, content in {**made.files, "any.dcf": made.content}.items():
            (Path(folder) / name).write_bytes(content)
        plan = difference(other, Dictionary.load(Path(folder) / "any.dcf"))
        for write in plan.writes():
            other.download(*write)
        read_back(other, plan.dictionary, plan.wanted)
        assert {address: other.upload(address) for address in wanted} == wanted


@given(files())
def test_a_device_stores_what_configure_and_a_dcf_call_its_parameters(file: File) -> None:
    agree_on_parameters(Dictionary.read(file.data, Path("any.eds"), NODE_ID))
