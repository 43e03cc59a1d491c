"""The pictures that every run's folder holds."""

from collections.abc import Callable, Mapping
from pathlib import Path

from hj_cosim.analysis.figures.snapshots import snapshots
from hj_cosim.analysis.figures.style import Drawing, save_drawing
from hj_cosim.analysis.figures.timeline import timeline
from hj_cosim.recording.run_folder import FIGURES, Run, read_run

PICTURES: Mapping[str, Callable[[Run], Drawing]] = {"snapshots.png": snapshots, "timeline.png": timeline}

Progress = Callable[[int, int], None]


def draw_run(folder: Path, progress: Progress | None = None) -> list[Path]:
    """Draw a run's pictures into its folder: the drive from above, and its time line.

    Args:
        folder: of the run.
        progress: called with the pictures drawn and the pictures in all.

    Returns:
        The files written.

    Raises:
        RunFolderError: if `folder` holds no run.
    """
    run = read_run(folder)
    written: list[Path] = []
    for done, (name, draw) in enumerate(PICTURES.items()):
        if progress is not None:
            progress(done, len(PICTURES))
        written += save_drawing(draw(run), folder / FIGURES / name)
    if progress is not None:
        progress(len(PICTURES), len(PICTURES))
    return written
