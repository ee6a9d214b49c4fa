"""Pictures of direct light without Cycles, where they come out the same: closures in closed form, shadows by Embree.

Cycles renders the first hits and their closures once (:mod:`.closures`, :mod:`.first_hits`); each light is then one
pass of a compiled kernel over the pixels, and one shadow ray for each that faces it (:mod:`.shadows`,
:mod:`.pictures`). A capture is made so after a comparison with Cycles under random lights (:mod:`.capture`).
"""

from .capture import CLOSED_FORM, Renderer, again, choose, make
from .closures import Inexact
from .pictures import ClosedForm, prepare

__all__ = ["CLOSED_FORM", "ClosedForm", "Inexact", "Renderer", "again", "choose", "make", "prepare"]
