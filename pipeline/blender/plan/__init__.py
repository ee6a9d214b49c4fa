"""Which effects of light transport a scene calls for.

First the scene itself rules effects out (:mod:`.contents`); what is left is switched off in small pictures, one effect
at a time, and compared by group of surfaces (:mod:`.probe`, :mod:`.decide`). An effect is simulated when leaving it
out may change any group by more than a third of the error asked for. What was decided is checked on finished pictures
(:mod:`.audit`).
"""

from .decide import MOST_BOUNCES, decide, own_light, unmeasured
from .effects import NOISE, SATURATION, Effect, Plan

__all__ = ["MOST_BOUNCES", "NOISE", "SATURATION", "Effect", "Plan", "decide", "own_light", "unmeasured"]
