"""The equation of motion of a block, slender or exact, for kernels that hold for both: see `by_body`."""

from fpk_rocking.physics.motion import exact, slender
from fpk_rocking.physics.motion.body import by_body

WORK = exact.WORK

lift = by_body(slender.lift, exact.lift)
cosine = by_body(slender.cosine, exact.cosine)
steepness = by_body(slender.steepness, exact.steepness)
stays_below = by_body(slender.stays_below, exact.stays_below)
pulls = by_body(slender.pulls, exact.pulls)
launch = by_body(slender.launch, exact.launch)
later = by_body(slender.later, exact.later)
rising_time = by_body(slender.rising_time, exact.rising_time)
flight = by_body(slender.flight, exact.flight)
