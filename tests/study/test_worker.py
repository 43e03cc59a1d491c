import io
import pickle
import subprocess
import sys

import pytest

from hj_cosim.study import worker

REQUEST = pickle.dumps(pickle.dumps("x" * 9000))  # framed, as the study sends it


@pytest.mark.parametrize("sent", [b"", REQUEST[:4000]], ids=["between_two_requests", "within_a_request"])
def test_a_worker_whose_study_is_gone_ends_at_once(sent):
    with subprocess.Popen(
        [sys.executable, "-m", worker.__name__], stdin=subprocess.PIPE, stderr=subprocess.PIPE
    ) as own:
        try:
            _, said = own.communicate(sent, timeout=60.0)
        finally:
            own.kill()
    assert (own.returncode, said) == (0, b"")


def test_a_request_that_is_cut_off_anywhere_ends_a_worker(monkeypatch):
    def leave(status):
        raise SystemExit(status)

    monkeypatch.setattr(worker.os, "_exit", leave)
    short = pickle.dumps(pickle.dumps("x"))
    for length in range(len(short)):
        with pytest.raises(SystemExit) as left:
            worker._receive(io.BytesIO(short[:length]), worker.SimpleQueue())
        assert left.value.code == 0
