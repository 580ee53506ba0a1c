"""Whether this machine can render off screen, asked in a process of its own.

VTK ends the whole process where it finds no OpenGL library, so it must not be tried in the caller's.
"""

import dataclasses
import signal
import subprocess
import sys

__all__ = ["Rendering", "probe_rendering"]

_LIBRARIES = ("libGL.so.1", "libEGL.so.1", "libOSMesa.so.8")
_PROBE = f"""
import ctypes, sys
if sys.platform.startswith("linux"):
    for name in {_LIBRARIES!r}:
        try:
            ctypes.CDLL(name)
        except OSError:
            print("missing", name, flush=True)
import pyvista
plotter = pyvista.Plotter(off_screen=True, window_size=(16, 16))
plotter.add_mesh(pyvista.Plane())
plotter.show(auto_close=False)
assert plotter.screenshot(return_img=True).std() > 0.0
print("rendered", flush=True)
"""


@dataclasses.dataclass(frozen=True)
class Rendering:
    """Outcome of the probe.

    Attributes
    ----------
    works : bool
        Whether an off-screen picture was rendered.
    missing : tuple of str
        OpenGL libraries that were looked for and not found, whether or not rendering works without them.
    reason : str
        One line for the reader: why it does not work, empty where it does.
    """

    works: bool
    missing: tuple[str, ...]
    reason: str


def probe_rendering(timeout_s=60.0, program=_PROBE) -> Rendering:
    """Render a small picture off screen in a subprocess and say how that went; never raises.

    Parameters
    ----------
    timeout_s : float
        Seconds after which the probe is given up.
    program : str
        The probe, in Python: it prints "missing" with the name of each library that lacks, and "rendered".

    Returns
    -------
    Rendering
    """
    command = [sys.executable, "-c", program]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=timeout_s, check=False)
    except subprocess.TimeoutExpired:
        return Rendering(False, (), f"the off-screen rendering probe did not answer within {timeout_s:g} s")
    except OSError as error:
        return Rendering(False, (), f"the off-screen rendering probe could not be started: {error}")
    lines = done.stdout.splitlines()
    missing = tuple(line.split()[1] for line in lines if line.startswith("missing "))
    if done.returncode == 0 and "rendered" in lines:
        return Rendering(True, missing, "")
    return Rendering(False, missing, _reason(done, missing))


def _reason(done, missing) -> str:
    """Why the probe, a finished process, rendered nothing, in one line; `missing` are the libraries that lack."""
    if "No module named 'pyvista'" in done.stderr:
        return "pyvista is not installed (pip install 'fpk-rocking[view]')"
    ended = f"exit status {done.returncode}"
    if done.returncode < 0:
        ended = signal.Signals(-done.returncode).name
    if missing:
        return f"VTK cannot render here ({ended}): OpenGL library not found: {', '.join(missing)}"
    last = done.stderr.strip().splitlines()[-1:] or ["no message"]
    return f"VTK cannot render here ({ended}): {last[0]}"
