"""How much memory a drive takes, by its length and the cars in it: `hj-cosim run` whole, pictures included.

Every drive is a process of its own, whose peak is what the system says of it. Planner idle, filter none.
"""

import json
import subprocess
import sys
from pathlib import Path

import pytest

# VmHWM: ru_maxrss would be at least what the process that started this one had at its peak.
DRIVE = """
import json, sys, time
from pathlib import Path
from hj_cosim import run_episode
scenario, duration, cars, out = sys.argv[1:]
started = time.perf_counter()
settings = {"recording.cars": cars, "simulation.on_collision": "continue"}
episode = run_episode(
    scenario, planner="idle", filter="none", duration=float(duration), out=out, settings=settings
)
peak = float(Path("/proc/self/status").read_text().split("VmHWM:")[1].split()[0]) / 1024
print(json.dumps({"peak": peak, "samples": episode.summary["samples"], "seconds": time.perf_counter() - started}))
"""
# Cars, what is recorded, and the drives' lengths, s.
DRIVES = [(500, "all", (30, 120, 600)), (500, "near", (30, 120, 600)), (5000, "all", (30, 120, 600))]


def scenario(folder: Path, count: int) -> Path:
    """Write a scenario of `count` cars, as dense as the paper's, a third of them behind the robot."""
    length = 40_000 + 20 * count
    lanes = "".join(
        f'<lane id="highway_{lane}" index="{lane}" speed="60" length="{length}" width="4"'
        f' shape="0,{4 * lane} {length},{4 * lane}"/>'
        for lane in range(4)
    )
    (folder / "long.net.xml").write_text(
        '<net version="1.20"><location netOffset="0,0" convBoundary="0,0,1,1" origBoundary="0,0,1,1"'
        f' projParameter="!"/><edge id="highway" from="a" to="b" priority="1">{lanes}</edge>'
        '<junction id="a" type="dead_end" x="0" y="0" incLanes="" intLanes="" shape="0,0 0,1"/>'
        f'<junction id="b" type="dead_end" x="{length}" y="0" incLanes="" intLanes="" shape="{length},0 {length},1"/>'
        "</net>"
    )
    behind = count // 3
    path = folder / f"{count}.toml"
    path.write_text(
        f'name = "many"\n[network]\nfile = "long.net.xml"\n[traffic]\ncount = {count - behind}\n'
        f"count_behind = {behind}\ncheck_collisions = false\n"
    )
    return path


@pytest.mark.parametrize(("count", "cars", "durations"), DRIVES)
def test_memory_does_not_grow_with_a_drive(tmp_path, count, cars, durations):
    peaks = []
    for duration in durations:
        arguments = [str(scenario(tmp_path, count)), str(duration), cars, str(tmp_path / str(duration))]
        done = subprocess.run([sys.executable, "-c", DRIVE, *arguments], capture_output=True, text=True, check=True)
        found = json.loads(done.stdout.splitlines()[-1])
        file = tmp_path / str(duration) / "trajectories.parquet"
        size = file.stat().st_size / 2**20
        peaks.append(found["peak"])
        print(
            f"\n{count} cars, {cars}, {duration} s: {found['samples']} samples, peak {found['peak']:.0f} MB,"
            f" file {size:.0f} MB, {found['seconds']:.0f} s",
            end="",
        )
        file.unlink()
    assert peaks[-1] <= 500.0 if count == 500 else peaks[-1] <= peaks[1] + 60.0
