"""Scene: what is shot at what, and what is recorded of it."""

from typing import Literal

from .core import AnyCore
from .interaction import Interaction
from .model import Model
from .plate import Plate


class Record(Model):
    standoffs: tuple[float, ...] = ()
    standoff_point: Literal["centre_of_mass", "nose"] = "centre_of_mass"
    bending: bool = False


class Target(Model):
    plate: Plate


class Scene(Model):
    core: AnyCore
    target: Target
    interaction: Interaction = Interaction()
    record: Record = Record()
