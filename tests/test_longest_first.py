"""The order of the tests, with tests and a cache that are made up."""

from types import SimpleNamespace

from longest_first import AT_FIRST, KEPT, Durations, by_seconds


class CacheInMemory(dict):
    def set(self, key, value):
        self[key] = value


def items(*names):
    return [SimpleNamespace(nodeid=name) for name in names]


def test_the_longest_files_come_first_and_nothing_else_moves():
    ordered = items("a.py::x", "b.py::y", "a.py::z", "new.py::n", "c.py::u", "new.py::m", "c.py::v")
    by_seconds(ordered, {"a.py": 1.0, "c.py": 5.0, "b.py": 2.0})
    assert [item.nodeid for item in ordered] == [
        "c.py::u", "c.py::v", "b.py::y", "a.py::x", "a.py::z", "new.py::n", "new.py::m"
    ]  # fmt: skip


def test_how_long_files_take_is_remembered_and_told_to_every_worker():
    cache = CacheInMemory()
    first = Durations(SimpleNamespace(cache=cache))
    assert first.known == AT_FIRST
    for nodeid, duration in (("a.py::x", 1.5), ("a.py::x", 0.5), ("b.py::y[1]", 3.0)):
        first.pytest_runtest_logreport(SimpleNamespace(nodeid=nodeid, duration=duration))
    first.pytest_sessionfinish()
    again = Durations(SimpleNamespace(cache=cache))
    assert again.known == {**AT_FIRST, "a.py": 2.0, "b.py": 3.0}
    worker = SimpleNamespace(workerinput={})
    again.pytest_configure_node(worker)
    assert worker.workerinput[KEPT] == again.known
    again.pytest_sessionfinish()
    assert cache[KEPT] == again.known


def test_without_a_cache_the_known_long_ones_come_first():
    durations = Durations(SimpleNamespace())
    durations.pytest_sessionfinish()
    assert durations.known == AT_FIRST
