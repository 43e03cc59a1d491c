"""Tables that somebody made to harm: refused in a sentence, before memory is taken, and nothing that they name runs."""

import io
import json
import tracemalloc
import zipfile
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from test_systems import USER_DYNAMICS
from test_value_table import SPECIFICATION

from hj_cosim.errors import TableError
from hj_cosim.reachability.table.store import load_table, read_table

Members = dict[str, bytes]
MEGABYTE = 2**20
MEMORY = 16 * MEGABYTE  # what refusing may take


@pytest.fixture
def table_file(tmp_path: Path) -> Path:
    """Return a good table's file, beside its specification."""
    specification = tmp_path / "braking.toml"
    specification.write_text(SPECIFICATION)
    load_table(str(specification))
    return specification.with_suffix(".npz")


def members_of(path: Path) -> Members:
    with zipfile.ZipFile(path) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def npy(array: np.ndarray) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array(stream, array, allow_pickle=True)
    return stream.getvalue()


def values_of(members: Members) -> np.ndarray:
    return np.load(io.BytesIO(members["values.npy"]))


def only_header(shape: tuple[int, ...]) -> bytes:
    stream = io.BytesIO()
    np.lib.format.write_array_header_1_0(stream, {"descr": "<f4", "fortran_order": False, "shape": shape})
    return stream.getvalue()


def with_value(members: Members, value: float) -> bytes:
    values = values_of(members).copy()
    values[3, 4] = value
    return npy(values)


def changed_report(members: Members, **changes: object) -> bytes:
    report = json.loads(str(np.load(io.BytesIO(members["report.npy"]))))
    return npy(np.array(json.dumps(report | changes)))


# Each case: which member becomes what, and what the answer must say.
HARMFUL: dict[str, tuple[str, Callable[[Members], bytes], str]] = {
    "pickled values": ("values.npy", lambda m: npy(np.array([{"a": 1}, None], object)), "Python objects"),
    "a header of a million times a million": ("values.npy", lambda m: only_header((10**6, 10**6)), "of shape"),
    "a header of more than memory can be": ("values.npy", lambda m: only_header((2**62, 8)), "of shape"),
    "a negative shape": ("values.npy", lambda m: only_header((-21, -11)), "of shape"),
    "128 megabytes of zeros": ("values.npy", lambda m: npy(np.zeros(2**25, np.float32)), "of shape"),
    "the right header and more": ("values.npy", lambda m: m["values.npy"] + bytes(2**26), "bytes, which shape"),
    "the right header and less": ("values.npy", lambda m: m["values.npy"][:-8], "bytes, which shape"),
    "another type": ("values.npy", lambda m: npy(values_of(m).astype(np.float64)), "float64"),
    "another byte order": ("values.npy", lambda m: npy(values_of(m).astype(">f4")), ">f4"),
    "Fortran's order": ("values.npy", lambda m: npy(np.asfortranarray(values_of(m))), "Fortran"),
    "no array at all": ("values.npy", lambda m: b"\x80\x04cos\nsystem\n", "magic"),
    "code for a header": ("values.npy", lambda m: npy(np.zeros(1)).replace(b"'<f8'", b"exit()"), "malformed"),
    "NaN": ("values.npy", lambda m: with_value(m, np.nan), "values is not finite"),
    "infinity": ("values.npy", lambda m: with_value(m, np.inf), "values is not finite"),
    "a NaN node": ("axis0.npy", lambda m: npy(np.full(21, np.nan)), "axis0 is not finite"),
    "other nodes": ("axis1.npy", lambda m: npy(np.linspace(-2.0, 2.1, 11)), "axes are not those"),
    "another axis": ("axis2.npy", lambda m: npy(np.zeros(3)), "which is no table of"),
    "a specification of gigabytes": ("spec.npy", lambda m: npy(np.array("x" * 2**24)), "characters"),
    "a specification that is a number": ("spec.npy", lambda m: npy(np.array(3.0)), "spec is not a text"),
    "a specification that is none": ("spec.npy", lambda m: npy(np.array("{}")), "dynamics"),
    "a report nested without end": ("report.npy", lambda m: npy(np.array("[" * 900_000)), "recursion limit"),
    "a report of something else": ("report.npy", lambda m: changed_report(m, steps="many"), "steps"),
}  # fmt: skip


@pytest.mark.parametrize("case", HARMFUL)
def test_a_harmful_table_is_refused_in_a_sentence_before_memory_is_taken(table_file: Path, case: str) -> None:
    member, change, said = HARMFUL[case]
    members = members_of(table_file)
    members[member] = change(members)
    with zipfile.ZipFile(table_file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    del members
    tracemalloc.start()
    with pytest.raises(TableError, match="delete it and solve it again") as refused:
        read_table(table_file)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert said in str(refused.value)
    assert str(table_file) in str(refused.value)
    assert peak < MEMORY


def test_a_zip_that_claims_a_hundred_gigabytes_is_refused_before_memory_is_taken(table_file: Path) -> None:
    members = members_of(table_file)
    with zipfile.ZipFile(table_file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
        for info in archive.infolist():
            if info.filename == "values.npy":
                info.file_size = 10**11  # in the directory, which is written now
    tracemalloc.start()
    with pytest.raises(TableError, match="delete it and solve it again"):
        read_table(table_file)
    assert tracemalloc.get_traced_memory()[1] < MEMORY
    tracemalloc.stop()


@pytest.mark.parametrize("longer", [8, -8])
def test_a_zip_whose_member_is_not_as_long_as_it_claims_is_refused(table_file: Path, longer: int) -> None:
    members = members_of(table_file)
    size = len(members["values.npy"])
    members["values.npy"] = (members["values.npy"] + bytes(8))[: size + longer]
    with zipfile.ZipFile(table_file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
        archive.getinfo("values.npy").file_size = size
    with pytest.raises(TableError, match="delete it and solve it again"):
        read_table(table_file)


@pytest.mark.parametrize("bit", [0x1, 0x20, 0x40])
def test_a_zip_with_a_flag_that_we_cannot_read_is_refused(table_file: Path, bit: int) -> None:
    with zipfile.ZipFile(table_file) as archive:
        infos = archive.infolist()
    content = bytearray(table_file.read_bytes())
    for info in infos:  # encrypted, patched, strongly encrypted
        content[info.header_offset + 6] |= bit
    place = 0
    while (place := content.find(b"PK\x01\x02", place)) >= 0:
        content[place + 8] |= bit
        place += 4
    table_file.write_bytes(content)
    with pytest.raises(TableError, match="delete it and solve it again"):
        read_table(table_file)


def test_a_member_that_is_there_twice_is_refused(table_file: Path) -> None:
    members = members_of(table_file)
    with pytest.warns(UserWarning, match="Duplicate"), zipfile.ZipFile(table_file, "a") as archive:
        archive.writestr("values.npy", members["values.npy"])
    with pytest.raises(TableError, match="delete it and solve it again"):
        read_table(table_file)


def test_a_python_file_that_a_table_names_is_not_run(tmp_path: Path) -> None:
    """The table is a game's of one's own, and good; then the file that it names does something else."""
    game, specification = tmp_path / "walker.py", tmp_path / "walker.toml"
    game.write_text(USER_DYNAMICS)
    specification.write_text(SPECIFICATION.replace('"double_integrator"', '"walker.py"'))
    solved = load_table(str(specification))
    game.write_text(f"open({str(tmp_path / 'proof')!r}, 'w')\n" + USER_DYNAMICS)
    with pytest.raises(TableError, match="is not run because a table says so; load it by its specification"):
        read_table(specification.with_suffix(".npz"))
    assert not (tmp_path / "proof").exists()
    game.write_text(USER_DYNAMICS)
    back = read_table(specification.with_suffix(".npz"), solved.specification)
    np.testing.assert_array_equal(back.values, solved.values)
