"""What every table, figure and file says beside its numbers: whose they are, for which noise, what was assumed."""

__all__ = ["label_of", "name_of", "noise_text", "remarks"]

_INFERRED_BAND = (0.0, 10.0)


def name_of(result) -> str:
    """Return the name of a result's engine, and of its method where it has one."""
    return f"Monte Carlo {result.method}" if hasattr(result, "realizations") else "Fokker-Planck density"


def label_of(result) -> str:
    """Return the name of a result and the size of an ensemble, as in ``"Monte Carlo rk4, 1,000 realizations"``."""
    size = f", {result.realizations:,} realizations" if hasattr(result, "realizations") else ""
    return name_of(result) + size


def noise_text(noise) -> str:
    """One line that names a noise and its parameters (nondimensional).

    Parameters
    ----------
    noise : BandNoise, WhiteNoise or NoNoise
        The noise of a scene.

    Returns
    -------
    str
        For example ``"band noise, variance 0.04 on [0, 10], 100 harmonics"``.
    """
    if noise.kind == "band":
        low, high = noise.band
        return f"band noise, variance {noise.variance:g} on [{low:g}, {high:g}], {noise.harmonics} harmonics"
    if noise.kind == "white":
        return f"white noise, diffusion {noise.diffusion:.6g}"
    return "no noise"


def remarks(*results) -> tuple[str, ...]:
    """Sentences that have to stand wherever these results are shown.

    Parameters
    ----------
    *results
        Results of either engine.

    Returns
    -------
    tuple of str
        The inferred noise band, and how band noise became white noise for a density, each once; empty if neither
        applies.
    """
    sentences = []
    for result in results:
        noise = result.scene.noise
        if noise.kind == "band" and tuple(noise.band) == _INFERRED_BAND:
            sentences.append(
                "The noise band [0, 10] is inferred by this project from the paper's claims; the paper states no band."
            )
        if getattr(result, "closure", ""):
            sentences.append(result.closure)
    return tuple(dict.fromkeys(sentences))
