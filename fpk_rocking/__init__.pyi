"""What the front of the package exports, for type checkers: the front itself loads it on first use."""

from fpk_rocking.analytics import melnikov as melnikov
from fpk_rocking.density import Evolution as Evolution
from fpk_rocking.density import solve_fpk as solve_fpk
from fpk_rocking.horizon import CycleOperator as CycleOperator
from fpk_rocking.scene import BandNoise as BandNoise
from fpk_rocking.scene import Block as Block
from fpk_rocking.scene import Body as Body
from fpk_rocking.scene import CloughPenzien as CloughPenzien
from fpk_rocking.scene import Dimensions as Dimensions
from fpk_rocking.scene import Filter as Filter
from fpk_rocking.scene import FilteredNoise as FilteredNoise
from fpk_rocking.scene import Forcing as Forcing
from fpk_rocking.scene import Harmonic as Harmonic
from fpk_rocking.scene import Harmonics as Harmonics
from fpk_rocking.scene import LinearFilter as LinearFilter
from fpk_rocking.scene import NoNoise as NoNoise
from fpk_rocking.scene import Overturning as Overturning
from fpk_rocking.scene import Pulse as Pulse
from fpk_rocking.scene import Record as Record
from fpk_rocking.scene import Scene as Scene
from fpk_rocking.scene import Start as Start
from fpk_rocking.scene import StateSpace as StateSpace
from fpk_rocking.scene import WhiteNoise as WhiteNoise
from fpk_rocking.scene import load_scene as load_scene
from fpk_rocking.studies.probability import probability as probability

__version__: str
