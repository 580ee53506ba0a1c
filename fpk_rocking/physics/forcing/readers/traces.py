"""What ObsPy reads, where it is installed: MiniSEED, SAC, GSE2, Kinemetrics' EVT."""

import pathlib
import warnings

import numpy as np

from fpk_rocking.physics.forcing.readers.components import Component, ReadingError
from fpk_rocking.physics.forcing.readers.fields import integer

EXTRA = ' (pip install "fpk-rocking[obspy]")'

FORMATS = ("SAC", "KINEMETRICS_EVT", "GSE2", "GSE1", "MSEED", "SACXY", "TSPAIR", "SLIST")
"""Formats that it is asked for: neither PICKLE, whose files may run anything, nor those without a mark of their own."""

_CALIBRATED = ("KINEMETRICS_EVT",)
"""Formats whose calib makes the samples m/s²."""


def components(path: pathlib.Path) -> tuple[str, list[Component]] | None:
    """(format, components) of a file; None where ObsPy cannot read it, or is missing."""
    try:
        import obspy
    except ImportError:
        return None
    for form in FORMATS:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                stream = obspy.read(str(path), format=form)
        except Exception:  # noqa: BLE001, S112  (its readers raise whatever they meet)
            continue
        return form, [_component(trace, form) for trace in stream]
    return None


def _component(trace, form):
    """The component of a trace."""
    about, calibrated = trace.stats, form in _CALIBRATED
    calib, channel, sac = float(about.calib), about.channel, getattr(about, "sac", {})
    if calib != 1.0 and not calibrated:
        accepted = "1, as it may be in the samples already, or be for another unit: write accelerations to the file"
        raise ReadingError(
            f"a calibration factor of {calib:g} in the header ({form})", f"{accepted}, with trace.stats.calib = 1"
        )
    integer(len(trace.data))
    samples = np.ma.filled(np.asanyarray(trace.data, dtype=float), np.nan) * calib
    if not np.isfinite(samples).all():
        raise ReadingError("samples that are missing or not finite", "one component without gaps")
    quantity = {6: "displacement", 7: "velocity", 50: "counts"}.get(int(sac.get("idep", 0)), "acceleration")
    if len(channel) == 3 and channel[1] in "HL" and quantity == "acceleration" and sac.get("idep") != 8:
        quantity = "seismometer's velocity"
    if trace.data.dtype.kind in "iu" and not calibrated:
        quantity = "counts"
    inclination = float(sac.get("cmpinc", 90.0))
    vertical = channel[-1:] in ("Z", "U", "V") or inclination in (0.0, 180.0)
    name, unit = f"channel {channel}" if channel.isdecimal() else channel, "m/s2" * calibrated
    name += " DOWN" * (inclination == 180.0)
    return Component(name, samples, float(about.delta), unit, quantity, vertical, event=trace.id)
