"""Users' configurations as they come: what is read, what is copied, what is silenced, what is refused."""

import gzip
import math
from pathlib import Path

import pytest
from own_configurations import content, network, simulation

from hj_cosim.errors import ConfigurationError
from hj_cosim.traffic.sources.own_configuration import copy_configuration, own_seed, read_options


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    copies = tmp_path / "copies"
    copies.mkdir()
    return copies


def configuration(path: Path, inside: str) -> Path:
    path.write_text(f"<configuration>{inside}</configuration>")
    return path


def copied(path: Path, folder: Path) -> str:
    """Return the text of all copies."""
    copy_configuration(path, folder)
    return "\n".join(file.read_text() for file in sorted(folder.iterdir()))


def test_paths_are_absolute_and_all_but_outputs_and_chatter_is_kept(tmp_path, folder):
    own = copy_configuration(simulation(tmp_path / "theirs"), folder)
    assert own.network == tmp_path / "theirs" / "in" / "road.net.xml"
    assert (own.begin, own.end, own.step) == (0.0, 400.0, 0.5)
    kept = read_options(own.copy)
    assert kept == own.options
    assert kept["route-files"] == str(tmp_path / "theirs" / "in" / "cars.rou.xml")
    assert kept["lateral-resolution"] == "0.8"
    assert set(kept) == {
        "net-file", "route-files", "additional-files", "begin", "end", "step-length", "lateral-resolution"
    }  # fmt: skip


def test_what_detectors_and_edge_data_would_write_goes_nowhere_and_the_rest_of_their_file_stays(tmp_path, folder):
    own = copy_configuration(simulation(tmp_path / "theirs"), folder)
    text = Path(own.options["additional-files"]).read_text()
    assert text.count('file="/dev/null"') == 3
    assert text.count('dest="/dev/null"') == 1
    for kept in ('id="loop"', 'pos="100"', 'lane="e0_0"', 'type="SaveTLSSwitchStates"'):
        assert kept in text
    assert "inductionLoop loop of detectors.add.xml -> loops.xml" in own.silenced
    assert "fcd-output = fcd.xml" in own.silenced


def test_a_file_that_writes_nothing_is_used_where_it_is_and_one_that_is_read_is_found_from_the_copy(tmp_path, folder):
    network(tmp_path / "road.net.xml")
    (tmp_path / "polygons.xml").write_text('<additional><poly id="p" shape="0,0 1,1"/></additional>')
    (tmp_path / "inner.xml").write_text('<additional><edgeData id="inner" file="inner-out.xml"/></additional>')
    (tmp_path / "signs.xml").write_text("<additional/>")
    (tmp_path / "outer.xml").write_text(
        '<additional><include href="inner.xml"/><variableSpeedSign id="s" lanes="e0_0" file="signs.xml"/>'
        '<calibrator id="c" edge="e0" pos="0" output="c.xml"/>'
        '<vType id="t"><param key="device.ssm.file" value="ssm.xml"/></vType></additional>'
    )
    own = configuration(
        tmp_path / "a.sumocfg",
        '<net-file value="road.net.xml"/><additional-files value="polygons.xml, outer.xml"/>',
    )
    text = copied(own, folder)
    assert f"{tmp_path / 'polygons.xml'}," in text
    assert f'file="{tmp_path / "signs.xml"}"' in text
    for written in ("inner-out.xml", '"c.xml"', '"ssm.xml"', 'href="inner.xml"'):
        assert written not in text
    assert text.count("/dev/null") == 3


def test_packed_files_are_copied_unpacked(tmp_path, folder):
    network(tmp_path / "road.net.xml")
    with gzip.open(tmp_path / "d.add.xml.gz", "wt") as file:
        file.write('<additional><edgeData id="e" file="out.xml"/></additional>')
    own = copy_configuration(
        configuration(tmp_path / "a.sumocfg", '<n v="road.net.xml"/><a v="d.add.xml.gz"/><e value="0:02:03"/>'), folder
    )
    assert "/dev/null" in Path(own.options["a"]).read_text()
    assert own.end == 123.0
    assert own.network == tmp_path / "road.net.xml"


def test_a_configuration_without_an_end_has_none_and_its_seed_counts(tmp_path, folder):
    network(tmp_path / "road.net.xml")
    path = configuration(tmp_path / "a.sumocfg", '<net-file value="road.net.xml"/><end value="-1"/><seed value="42"/>')
    assert math.isinf(copy_configuration(path, folder).end)
    assert own_seed(path) == 42
    assert "seed" not in copy_configuration(path, folder).options


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("<configuration/>", "names no network"),
        ("<routes/>", r"no SUMO configuration: its root is <routes>"),
        ("<configuration>", "is not XML"),
        ("", "is not XML"),
        ('<!DOCTYPE c [<!ENTITY a "b">]><configuration>&a;</configuration>', "has a DOCTYPE"),
        (
            '<configuration><net-file value="nowhere.net.xml"/></configuration>',
            r"'nowhere\.net\.xml': there is no such",
        ),
        (
            '<configuration><net-file value="a.sumocfg"/><load-state value="gone.xml.gz"/></configuration>',
            r"a\.sumocfg: load-state = 'gone\.xml\.gz': there is no such",
        ),
        (
            '<configuration><net-file value="a.sumocfg"/><begin value="soon"/></configuration>',
            "begin = 'soon' is no time",
        ),
    ],
)
def test_what_is_no_configuration_is_refused_in_a_sentence(tmp_path, folder, text, said):
    path = tmp_path / "a.sumocfg"
    path.write_text(text)
    before = content(tmp_path)
    with pytest.raises(ConfigurationError, match=said):
        copy_configuration(path, folder)
    assert {name: data for name, data in content(tmp_path).items() if "copies" not in name} == before


def test_files_that_include_each_other_are_refused(tmp_path, folder):
    network(tmp_path / "road.net.xml")
    for one, other in (("a", "b"), ("b", "a")):
        (tmp_path / f"{one}.xml").write_text(f'<additional><include href="{other}.xml"/></additional>')
    path = configuration(tmp_path / "a.sumocfg", '<net-file value="road.net.xml"/><additional-files value="a.xml"/>')
    text = copied(path, folder)
    assert text.count("<include") == 2  # each is copied once, and SUMO says what it thinks of it
