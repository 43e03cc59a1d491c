"""An engine for tests of what is independent of engines."""

from collections.abc import Generator, Sequence

from hj_cosim.errors import HjCosimError
from hj_cosim.study.jobs import EpisodeFunction, EpisodeJob, Outcome


class InThisProcess:
    """An engine for tests of what is independent of engines."""

    def run(self, jobs: Sequence[EpisodeJob], function: EpisodeFunction) -> Generator[Outcome, None, None]:
        for job in jobs:
            try:
                function(job)
            except HjCosimError as error:
                yield Outcome(job, str(error), "its log")
            else:
                yield Outcome(job)
