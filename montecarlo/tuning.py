"""Every tuned number of the Monte Carlo engines, in one table; none changes what a result means."""

from typing import NamedTuple


class Tuning(NamedTuple):
    """Numbers that trade speed for accuracy or memory; kernels read them from `TUNING`. Times are nondimensional."""

    # The time grid.
    most_intervals: int = 2**22  # in a table period: tables of some 100 MB
    # The engine "exact".
    exact_fewest: int = 12  # intervals in the forcing's shortest period at least; flights need no more
    exact_longest: float = 0.2  # longest interval: the polynomials of a flight are right to 1e-14 over it
    envelope_order: int = 8  # coefficients of an envelope that is not linear, in an interval: right to 1e-12
    # The engine "white".
    white_fewest: int = 16  # intervals in the forcing's shortest period at least
    white_longest: float = 0.075  # longest interval
    barrier_distance: float = 4.0  # standard deviations of the noise by which a step stays away from a barrier
    finest_step: int = 256  # shortest steps in one of `steps_per_cycle`; the bias is of first order in their length
    sure_arrival: float = 1e-3  # a block arrives at a barrier after t at speed w on time if 2 D t < sure_arrival w^2
    longest_arrival: float = 0.02  # longest flight that is drawn as one step to its arrival at a barrier
    bounce_time: float = 0.5  # longest time up, and as much down, of a bounce that is one draw, over an interval
    bounce_deviations: float = 4.0  # a bounce is one draw if one this many standard deviations longer is in time
    bounce_slowest: float = 0.01  # speed over D/acceleration; of such bounces two draws in nine are kept
    bounce_lost: float = 0.5  # share of the acceleration that may be lost in the longest bounce
    bounce_curved: float = 0.3  # share of the acceleration by which the force may leave its tangent in it, twice
    # The engine "filtered".
    filtered_fewest: int = 16  # intervals in the forcing's shortest period at least
    filtered_longest: float = 0.2  # longest interval
    filtered_smooth: float = 100.0  # longest interval x rate x `steps_per_cycle` of noise with a derivative: at 200
    filtered_rough: float = 50.0  # half a correlation time; a quarter without
    filtered_parts: int = 16  # of an interval in which noise without a derivative may cause an event
    filtered_margin: float = 2.0  # standard deviations of such noise from its polynomial that may cause one
    filtered_slowest: float = 1.0  # speed over interval below which a block may come to rest in it
    filtered_intervals: int = 2**20  # most in a time scale of the forcing
    # Batches of realizations.
    batch_seconds: float = 0.3  # that a batch should take: short enough to be interrupted, long enough for all threads
    smallest_batch: int = 64  # realizations
    first_batch: int = 4096  # states of the first batch
    followed: float = 0.5  # paths that are followed from overturning to the fall, over the root of the realizations
    most_states: int = 2**28  # of an ensemble: 4 GiB
    impacts_per_cycle: int = 16  # impacts a cycle for which there is space at first; with more a batch is repeated
    tally_states: int = 2**22  # most states that a tally holds at once: 64 MiB
    tally_bytes: int = 2**29  # most memory of the histograms of a tally: 512 MiB
    # Splitting.
    foresight: float = 7.0  # time for which the score follows the motion without noise
    score_angles: int = 32  # nodes of the table of the score in the angle; a rough score costs accuracy, not bias
    score_velocities: int = 64  # and in the velocity
    splitting_states: int = 2**26  # most records of the walkers, and most numbers of the repeats: 2.5 GiB
    splitting_intervals: int = 2000  # most in a cycle: the score then takes some 280 MB


TUNING = Tuning()
