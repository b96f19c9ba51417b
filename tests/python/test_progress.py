"""The progress bar of `kisspoint diagnose` moves as long as work is done, never falls, and shows the elapsed time."""

import os
import re
import subprocess
import sys
import time

import pytest
from conftest import ROOT, find_command

SHOWN = re.compile(rb"(\d+) %  +(\d+s)  (.*?)[\r\n\x1b]")


def watched(command):
    """Times at which each percentage was first shown, with the activity shown, and the total duration."""
    import fcntl
    import pty
    import struct
    import termios

    ours, theirs = pty.openpty()
    fcntl.ioctl(theirs, termios.TIOCSWINSZ, struct.pack("HHHH", 40, 110, 0, 0))
    begun = time.monotonic()
    process = subprocess.Popen(command, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=theirs, env={**os.environ, "TERM": "xterm"})
    os.close(theirs)
    shown, text = [], b""
    while True:
        try:
            text += os.read(ours, 65536)
        except OSError:
            break
        for percent, _, what in SHOWN.findall(text):
            if not shown or shown[-1][1] != int(percent):
                shown.append((time.monotonic() - begun, int(percent), what.decode()))
        text = text[text.rfind(b"\r") + 1 :]
    assert process.wait() == 0
    return shown, time.monotonic() - begun


@pytest.mark.skipif(sys.platform == "win32", reason="a terminal of its own is a thing of Unix")
def test_the_bar_of_a_diagnosis_moves(tmp_path):
    shown, total = watched([find_command(), "diagnose", ROOT / "tests/data/campaigns/example", "--out", tmp_path, "--no-fmu"])
    diagnosing = [(at, percent) for at, percent, what in shown if not what.startswith("reading")]
    percents = [percent for _, percent in diagnosing]
    assert percents == sorted(percents) and len(percents) > 15
    times = [0.0, *(at for at, _ in diagnosing), total]
    still = max(later - earlier for earlier, later in zip(times, times[1:]))
    assert still < 0.25 * total, f"{still:.1f} of {total:.1f} s at one figure: {diagnosing}"
