"""What a picture waits for: Matplotlib, and nothing that its own data do not need."""

import subprocess
import sys

PROGRAM = """
import sys
from pathlib import Path
from hj_cosim.analysis.figures.gallery import draw_figure
from hj_cosim.analysis.figures.style import save_drawing
from hj_cosim.analysis.run_figures import draw_run
run = Path(sys.argv[1])
draw_run(run)
save_drawing(draw_figure("timeline", run=run), run / "figures" / "timeline.csv")
print(sorted({"numba", "scipy", "pandas", "libsumo", "qpsolvers"} & sys.modules.keys()))
"""


def test_the_pictures_of_a_run_on_a_straight_road_need_no_compiler_and_no_pandas(make_hostile_run, tmp_path):
    run = make_hostile_run(tmp_path / "run", "plain")
    done = subprocess.run([sys.executable, "-c", PROGRAM, str(run)], capture_output=True, text=True, check=True)
    assert done.stdout == "[]\n"
    assert sorted(path.name for path in (run / "figures").iterdir()) == [
        "snapshots.png",
        "timeline.csv",
        "timeline.png",
    ]
