"""Who may look on while a study is driven."""

from collections.abc import Sequence
from typing import Protocol

from hj_cosim.study.folder import StudyFolder
from hj_cosim.study.jobs import EpisodeJob, Outcome


class Onlooker(Protocol):
    """Told of a study while it is driven; it changes nothing about it."""

    def begun(self, folder: StudyFolder, jobs: Sequence[EpisodeJob]) -> None:
        """Learn what the study consists of, and which episodes are still to be driven."""
        ...

    def started(self, job: EpisodeJob) -> None:
        """Learn that a process was handed a job, or a scheduler's worker begins with it; from a thread of its own."""
        ...

    def ended(self, outcome: Outcome, is_driven: bool) -> None:
        """Learn what became of a job."""
        ...
