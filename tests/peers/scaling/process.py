"""Runs a program and measures what it takes: CPU seconds and peak memory of that process."""

import os
import subprocess
import tempfile
import time
from pathlib import Path

# Seconds between looks at a program's memory.
STEP = 0.05
# Free memory that is left to others, bytes.
LEFT = 1 << 30


class Failure(Exception):
    """A program that failed, or was stopped."""


class Used:
    """What a process has taken, and its standard output."""

    def __init__(self, usage, output):
        self.cpu = usage.ru_utime + usage.ru_stime
        self.memory = 1024 * usage.ru_maxrss
        self.output = output


def run(command, memory, limit):
    """Runs a command with a limit of memory (bytes) and of wall time (seconds)."""
    with tempfile.TemporaryFile("w+") as output, tempfile.TemporaryFile("w+") as errors:
        process = subprocess.Popen([str(word) for word in command], stdout=output, stderr=errors)
        status, usage, stopped = wait(process, memory, limit)
        output.seek(0)
        errors.seek(0)
        if stopped or status:
            raise Failure(stopped or reason(errors.read(), status))
        return Used(usage, output.read())


def wait(process, memory, limit):
    """Waits for a process: its exit code, what it used, and why it was stopped, if it was."""
    start, stopped = time.monotonic(), None
    while True:
        done, status, usage = os.wait4(process.pid, os.WNOHANG)
        if done:
            process.returncode = os.waitstatus_to_exitcode(status)
            return process.returncode, usage, stopped
        stopped = stopped or excess(process.pid, memory, time.monotonic() - start, limit)
        if stopped:
            process.kill()
        time.sleep(STEP)


def excess(pid, memory, seconds, limit):
    """Why a process has to be stopped, or None."""
    taken = field(f"/proc/{pid}/status", "VmRSS")
    if taken > memory:
        return f"stopped at {taken / 1e9:.1f} GB of memory, after {seconds:.0f} s"
    if free() < LEFT:
        return f"stopped as the machine's memory ran out; it had {taken / 1e9:.1f} GB, after {seconds:.0f} s"
    return f"stopped after {seconds:.0f} s" if seconds > limit else None


def free():
    """Free memory of the machine, bytes."""
    return field("/proc/meminfo", "MemAvailable")


def field(path, name):
    """A number of bytes from a file of the kernel; 0 if it is absent."""
    try:
        lines = Path(path).read_text().splitlines()
    except OSError:
        return 0
    return next((1024 * int(line.split()[1]) for line in lines if line.startswith(f"{name}:")), 0)


def reason(errors, status):
    """What a program said of its failure: photoncard's line with a cross, else the last line that names an error, else the last one."""
    lines = [line.strip() for line in errors.splitlines() if line.strip()]
    crossed = [line.removeprefix("×").strip() for line in lines if line.startswith("×")]
    named = [line for line in lines if "error" in line.lower()]
    return (crossed or named or lines or [f"exit code {status}"])[-1]
