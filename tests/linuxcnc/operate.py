#!/usr/bin/python3
"""The operator, in place of a screen: `DISPLAY = operate.py` runs the program of job.json and records it.

Run by Debian's own Python, which has the module `linuxcnc`. job.json: `program`, `override` (of the feed), `set` (pins
to set before the start), `switch` (rows of seconds after the start, pin, value). Leaves recording.txt and said.json.
"""

import json
import subprocess
import time
from pathlib import Path

import linuxcnc

PATIENCE_S = 120.0


def until(condition, what):
    """Look at LinuxCNC's status until the condition holds."""
    end = time.monotonic() + PATIENCE_S
    while True:
        status.poll()
        if condition():
            return
        for error in iter(errors.poll, None):
            said.append(error[1].strip())
            if not said[-1].startswith("shapegcode_shaper:"):
                raise SystemExit(f"LinuxCNC says: {said[-1]}")
        if time.monotonic() > end:
            raise SystemExit(f"waited in vain: {what}")
        time.sleep(0.002)


def set_pin(pin, value):
    """By halcmd, as a user would."""
    subprocess.run(["halcmd", "setp", f"shapegcode-shaper.0.{pin}", str(value)], check=True)


def shown(what):
    """What halcmd shows."""
    return subprocess.run(["halcmd", "show", *what.split()], check=True, capture_output=True, text=True).stdout


job = json.loads(Path("job.json").read_text())
said = []
command, status, errors = linuxcnc.command(), linuxcnc.stat(), linuxcnc.error_channel()
try:
    command.state(linuxcnc.STATE_ESTOP_RESET)
    command.state(linuxcnc.STATE_ON)
    until(lambda: status.task_state == linuxcnc.STATE_ON, "on")
    command.mode(linuxcnc.MODE_MANUAL)
    command.wait_complete()
    command.home(-1)
    until(lambda: all(status.homed[:3]), "homed")
    command.mode(linuxcnc.MODE_AUTO)
    command.wait_complete()
    command.set_optional_stop(False)
    command.program_open(job["program"])
    command.feedrate(job.get("override", 1.0))
    for pin, value in job.get("set", {}).items():
        set_pin(pin, value)
    time.sleep(0.3)
    with Path("recording.txt").open("w") as file:
        sampler = subprocess.Popen(["halsampler", "-t"], stdout=file)
        time.sleep(0.3)
        command.auto(linuxcnc.AUTO_RUN, 0)
        until(lambda: status.interp_state != linuxcnc.INTERP_IDLE, "begun")
        start = time.monotonic()
        for seconds, pin, value in job.get("switch", []):
            until(lambda at=start + seconds: time.monotonic() >= at, "time to switch")
            set_pin(pin, value)
        until(lambda: status.interp_state == linuxcnc.INTERP_IDLE and status.inpos, "ended")
        time.sleep(0.5)
        sampler.terminate()
        sampler.wait()
finally:
    for error in iter(errors.poll, None):
        said.append(error[1].strip())
    Path("said.json").write_text(
        json.dumps({"errors": said, "thread": shown("thread"), "parameters": shown("param shapegcode-shaper")})
    )
