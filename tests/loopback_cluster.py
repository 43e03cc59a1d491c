"""A Dask cluster of real processes on this machine, for tests and a benchmark."""

import os
import re
import subprocess
import sys
import time
from pathlib import Path


class LoopbackCluster:
    """A scheduler and workers, each a process of its own that finds `synthetic_episodes`."""

    def __init__(self, folder: Path, path: str) -> None:
        self._folder = folder
        self._environment = {**os.environ, "PYTHONPATH": path, "DASK_DISTRIBUTED__SCHEDULER__WORKER_TTL": "20s"}
        self.processes: list[subprocess.Popen[bytes]] = []
        scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0", "--no-dashboard")
        self.address = self._await(scheduler, r"Scheduler at:\s+(tcp://\S+)")

    def add_worker(self) -> subprocess.Popen[bytes]:
        """Start a worker without a nanny, so that nothing replaces it when it is killed."""
        log = self._start(
            "worker", self.address, "--nthreads", "1", "--no-nanny", "--no-dashboard", "--host", "127.0.0.1"
        )
        self._await(log, r"Registered to")
        return self.processes[-1]

    def stop(self) -> None:
        for process in reversed(self.processes):
            process.kill()
            process.wait()

    def _start(self, kind: str, *arguments: str) -> Path:
        log = self._folder / f"{kind}-{len(self.processes)}.log"
        with log.open("wb") as stream:
            command = [sys.executable, "-m", f"distributed.cli.dask_{kind}", *arguments]
            self.processes.append(
                subprocess.Popen(command, stderr=stream, stdout=stream, env=self._environment, cwd=self._folder)
            )
        return log

    def _await(self, log: Path, pattern: str) -> str:
        for _ in range(1200):
            if found := re.search(pattern, log.read_text()):
                return found.group(found.re.groups)
            time.sleep(0.05)
        raise AssertionError(f"no {pattern!r} in {log.read_text()}")
