"""The process that drives episodes one after the other for `study.local_workers`.

It reads requests from standard input, each a pickle within a pickle: first the function that drives an episode, then
one EpisodeJob after the other. It answers each on standard output: READY, then None for a job that is done or a
NotDone for one that could not be. What it or SUMO prints goes to standard error. A programming error ends the
process, and the traceback is printed.
"""

import os
import pickle
import sys
import threading
from queue import SimpleQueue
from typing import BinaryIO

from hj_cosim.errors import HjCosimError, SimulationError
from hj_cosim.study.jobs import EpisodeFunction, EpisodeJob, NotDone

READY = "ready"


def main() -> None:
    """Serve until standard input ends."""
    replies = os.fdopen(os.dup(sys.stdout.fileno()), "wb")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())  # what SUMO prints must not run into the replies
    requests: SimpleQueue[bytes] = SimpleQueue()
    # Not sys.stdin itself: Python waits for its lock when it ends, and so for a study that has nothing more to say.
    stream = os.fdopen(os.dup(sys.stdin.fileno()), "rb")
    threading.Thread(target=_receive, args=(stream, requests), daemon=True).start()
    function: EpisodeFunction = pickle.loads(requests.get())
    _reply(replies, READY)
    while True:
        _reply(replies, _carry_out(pickle.loads(requests.get()), function))


def _receive(stream: BinaryIO, requests: "SimpleQueue[bytes]") -> None:
    """Pass on what the study sends; when the study is gone, be gone at once, in the middle of an episode, too.

    The outer pickle frames a request and can always be read here unless the study died over writing it; what is within
    may fail to, over a module that is not there, which must end the process and not this thread alone.
    """
    try:
        while True:
            requests.put(pickle.load(stream))
    except (EOFError, pickle.UnpicklingError):  # between two requests, or within one
        os._exit(0)


def _carry_out(job: EpisodeJob, function: EpisodeFunction) -> NotDone | None:
    try:
        function(job)
    except HjCosimError as error:
        return NotDone(str(error), process_is_spoilt=isinstance(error, SimulationError))
    return None


def _reply(stream: BinaryIO, reply: str | NotDone | None) -> None:
    pickle.dump(reply, stream)
    stream.flush()


if __name__ == "__main__":
    main()
