"""The package works from any folder: a wheel in an empty environment, run from an empty folder."""

import json
import os
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path

REPOSITORY = Path(__file__).resolve().parents[1]


def lend_kernels(installed):
    """Copy the kernels that are compiled here to the same sources elsewhere; Numba knows these by time and size."""
    for source in (REPOSITORY / "hj_cosim").rglob("*.py"):
        place = installed / source.relative_to(REPOSITORY / "hj_cosim")
        assert place.read_bytes() == source.read_bytes()
        os.utime(place, ns=(source.stat().st_atime_ns, source.stat().st_mtime_ns))
        for kernel in (source.parent / "__pycache__").glob(f"{source.stem}.*.nb[ic]"):
            place.parent.joinpath("__pycache__").mkdir(exist_ok=True)
            shutil.copy(kernel, place.parent / "__pycache__")


def lend_bytecode(libraries):
    """Copy what Python has compiled here of the same libraries; it checks by time and size that they are the same."""
    ours = Path(sysconfig.get_path("purelib"))
    for cache in ours.rglob("__pycache__"):
        place = libraries / cache.relative_to(ours)
        if place.parent.is_dir() and not place.exists():
            shutil.copytree(cache, place)


def test_wheel_in_an_empty_environment_drives_from_an_empty_folder(tmp_path, small_specification, small_table):
    assert small_specification.with_suffix(".npz").is_file(), "solved here, so that the wheel need not"
    uv = shutil.which("uv", path=str(Path(sys.executable).parent)) or shutil.which("uv")
    assert uv is not None, "uv, which the Makefile installs beside Python, is needed for this test"
    environment, elsewhere = tmp_path / "environment", tmp_path / "elsewhere"
    elsewhere.mkdir()
    python = environment / "bin" / "python"

    def run(*command, **options):
        done = subprocess.run([*map(str, command)], capture_output=True, text=True, cwd=elsewhere, **options)
        assert done.returncode == 0, done.stderr
        return done.stdout

    run(uv, "build", "--quiet", "--wheel", "--out-dir", tmp_path, REPOSITORY)
    (wheel,) = tmp_path.glob("*.whl")
    run(uv, "venv", "--quiet", "--python", sys.executable, environment)
    run(uv, "pip", "install", "--quiet", "--python", python, "--constraint", REPOSITORY / "constraints.txt", wheel)

    # Compiling all anew would take longer than all the rest, and is what every other test does in a fresh clone.
    (libraries,) = environment.glob("lib/python*/site-packages")
    lend_kernels(libraries / "hj_cosim")
    lend_bytecode(libraries)
    command = environment / "bin" / "hj-cosim"
    assert {"paper", "dense"} <= {row["name"] for row in json.loads(run(command, "scenarios", "--json"))}
    options = ("--duration", 2, "--planner", "idle", "--table", small_specification, "--json")
    summary = json.loads(run(command, "run", "paper", *options))
    assert summary["samples"] == 100
    assert Path(summary["folder"]).parent == elsewhere / "runs"
    assert (Path(summary["folder"]) / "figures" / "snapshots.png").is_file()
